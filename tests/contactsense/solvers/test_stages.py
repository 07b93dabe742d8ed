"""The three stages of Newton's method on smooth bodies, each by itself: quick, careful, sure."""

import numpy as np
import pytest

from contactsense.benchmarks.solvers.sampling import Contacts
from contactsense.robots.vectors import Vector
from contactsense.solvers import Status, Superquadric, solve_batch
from contactsense.solvers.general_convex.ellipsoid_method import bracket_contact
from contactsense.solvers.general_convex.general import solve_smooth_counted
from contactsense.solvers.general_convex.implicit_surfaces import evaluate
from contactsense.solvers.general_convex.level_set import SmoothBody
from contactsense.solvers.general_convex.newton import newton_iteration
from contactsense.solvers.general_convex.osculating import gauge_at, osculate, osculating_iteration
from contactsense.solvers.wrench import wrench_of
from tests.contactsense.solvers.contacts import draw

SIX = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def _body(surface: Superquadric) -> SmoothBody:
    body: SmoothBody = surface.newton_problem()[1][0]
    return body


def _vector(array: np.ndarray) -> Vector:
    x, y, z = array.tolist()
    return x, y, z


def test_the_osculating_ellipsoid_of_an_ellipsoid_has_its_contact() -> None:
    rng = np.random.default_rng(1)
    for _ in range(200):
        spread = rng.normal(size=(3, 3))
        Q = spread @ spread.T + 0.1 * np.eye(3)
        x = rng.normal(size=3)
        x /= np.sqrt(x @ Q @ x)
        u = rng.normal(size=3)
        u *= -np.sign(u @ Q @ x)
        v = rng.normal() * (Q @ x) + np.cross(x, u)
        there, found = osculate(tuple(Q[i] for i in SIX), _vector(u), _vector(v))
        assert there
        np.testing.assert_allclose(found, x, atol=1e-9)
    # No torsion, and the line passes by.
    assert not osculate((1.0, 1.0, 1.0, 0.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 2.0, 0.0))[0]


@pytest.mark.parametrize("gauge", [True, False])
def test_the_form_of_a_gauge_is_the_hessian_of_half_its_square(gauge: bool) -> None:
    """Both ways of finding it: from a gauge, and from a level set that is not one."""
    inner, extent = (0.0, 0.0, 0.0), (0.5, 0.7, 1.0)
    size = Superquadric(*extent, 3.0, 4.0).problem()[1][0].size
    rng = np.random.default_rng(2)
    for x in rng.normal(size=(20, 3)):
        # Without `gauge` the same function, about: one step of second order along the ray.
        near = x / (1.0 + evaluate(size, *(x * extent))[0])
        found = gauge_at(SmoothBody(size, inner, extent, gauge), _vector(near))
        assert found.there
        np.testing.assert_allclose(found.point, near, atol=1e-14)

        def half(y: np.ndarray) -> float:
            return 0.5 * (1.0 + evaluate(size, *(y * extent))[0]) ** 2

        step = 1e-4 * np.eye(3)
        slopes = [(half(near + e) - half(near - e)) / 2e-4 for e in step]
        np.testing.assert_allclose(found.gradient, slopes, atol=1e-6)
        bends = [
            (
                half(near + step[i] + step[j])
                - half(near + step[i] - step[j])
                - half(near - step[i] + step[j])
                + half(near - step[i] - step[j])
            )
            / 4e-8
            for i, j in SIX
        ]
        np.testing.assert_allclose(found.q, bends, atol=1e-5 * (1.0 + np.abs(bends).max()))


def _errors(surface: Superquadric, contacts: Contacts, found: np.ndarray) -> np.ndarray:
    condition = solve_batch(surface, contacts.force, contacts.moment).condition
    error = np.linalg.norm(found - contacts.centroid, axis=1) / np.linalg.norm(contacts.centroid, axis=1)
    return np.asarray(error / contacts.relative_condition(condition))


@pytest.mark.parametrize("exponents", [(2.5, 3.0), (8.0, 8.0), (30.0, 30.0)])
def test_cuts_enclose_every_contact(exponents: tuple[float, float]) -> None:
    """Without a start and whatever the curvature."""
    surface = Superquadric(0.05, 0.07, 0.1, *exponents)
    body = _body(surface)
    contacts = draw(surface, np.random.default_rng(3), 100, 0.5)
    found = []
    for force, moment in zip(contacts.force, contacts.moment, strict=True):
        cuts, place = bracket_contact(body, wrench_of(force, moment))
        assert 0 < cuts <= 300
        found.append(place)
    assert _errors(surface, contacts, np.array(found)).max() < 1e-9


def test_newton_converges_from_any_start() -> None:
    surface = Superquadric(0.05, 0.07, 0.1)
    body = _body(surface)
    contacts = draw(surface, np.random.default_rng(4), 300, 0.05)
    found, rows = [], []
    for row, (force, moment) in enumerate(zip(contacts.force, contacts.moment, strict=True)):
        answer = newton_iteration(body, max(body.extent), wrench_of(force, moment), body.inner)
        if answer.converged:
            found.append(answer.point)
            rows.append(row)
    assert len(rows) > 250
    some = Contacts(
        *(values[rows] for values in (contacts.centroid, contacts.normal, contacts.force)),
        contacts.moment[rows],
        contacts.torsion[rows],
    )
    assert _errors(surface, some, np.array(found)).max() < 1e-14


@pytest.mark.slow
def test_the_fallbacks_solve_what_the_fast_iteration_does_not() -> None:
    """Forces along the edges of a body that is nearly a box, with much torsion: some defeat the quick
    steps."""
    surface = Superquadric(0.05, 0.07, 0.1, 16.0, 16.0)
    body = _body(surface)
    contacts = draw(surface, np.random.default_rng(5), 20_000, 1.0)
    found = solve_batch(surface, contacts.force, contacts.moment)
    assert np.all(found.ok)
    assert found.residual.max() < 1e-12
    left = sure = 0
    for force, moment in zip(contacts.force, contacts.moment, strict=True):
        wrench = wrench_of(force, moment)
        if osculating_iteration(body, wrench).converged:
            continue
        left += 1
        answer, steps = solve_smooth_counted(wrench, body)
        assert answer.status == Status.OK
        sure += steps > 100
    assert left > 50
    assert sure > 0
