"""Newton's method on smooth bodies, packaged ones and others, and the patches of compound ones."""

import numpy as np
import pytest
from numba import njit

from contactsense.benchmarks.solvers.sampling import unit
from contactsense.solvers import (
    Box,
    Convex,
    Ellipsoid,
    Fingertip,
    Paraboloid,
    Polytope,
    Sphere,
    Status,
    Superquadric,
    Surface,
    solve,
    solve_batch,
)
from contactsense.solvers.general_convex.general import solve_smooth_counted
from contactsense.solvers.general_convex.implicit_surfaces import ELLIPSOID, evaluate
from contactsense.solvers.general_convex.level_set import SmoothBody
from contactsense.solvers.wrench import wrench_of
from tests.contactsense.solvers.contacts import draw

CUBE = [(x, y, z) for x in (-0.1, 0.1) for y in (-0.04, 0.04) for z in (-0.07, 0.07)]
STONE = unit(np.random.default_rng(1).normal(size=(30, 3))) * (0.1, 0.05, 0.07)


@njit(error_model="numpy")
def egg(
    size: tuple[float, float], x: float, y: float, z: float
) -> tuple[float, float, float, float, float, float, float, float, float, float]:
    """A convex body that is neither a gauge nor symmetric: blunt below, steep above."""
    a, b = size
    steep = np.exp(20.0 * z)
    return (
        (x / a) ** 2 + (y / b) ** 2 + 100.0 * z * z + 0.1 * steep - 1.0,
        2.0 * x / a**2,
        2.0 * y / b**2,
        200.0 * z + 2.0 * steep,
        2.0 / a**2,
        2.0 / b**2,
        200.0 + 40.0 * steep,
        0.0,
        0.0,
        0.0,
    )


SURFACES: dict[str, Surface] = {
    "superquadric 4": Superquadric(0.05, 0.07, 0.1),
    "superquadric 4, 2": Superquadric(0.05, 0.07, 0.1, 4.0, 2.0),
    "superquadric 2.5, 3": Superquadric(0.05, 0.07, 0.1, 2.5, 3.0),
    "superquadric 2": Superquadric(0.05, 0.07, 0.1, 2.0, 2.0),
    "fingertip": Fingertip(0.03),
    "cube": Polytope(CUBE, 0.01),
    "stone": Polytope(STONE, 0.005),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize("torsion", [0.0, 1e-8, 0.3])
def test_recovers_contacts(name: str, torsion: float) -> None:
    surface = SURFACES[name]
    contacts = draw(surface, np.random.default_rng(4), 2000, torsion)
    found = solve_batch(surface, contacts.force, contacts.moment)
    assert np.all(found.ok)
    error = np.linalg.norm(found.centroid - contacts.centroid, axis=1)
    error /= np.linalg.norm(contacts.centroid, axis=1)
    assert np.all(error <= 16 * np.finfo(float).eps * contacts.relative_condition(found.condition))
    assert found.residual.max() < 1e-12


@pytest.mark.slow
def test_newton_and_closed_form_agree_on_a_paraboloid() -> None:
    surface = Paraboloid(20.0, 10.0, 0.1)
    contacts = draw(surface, np.random.default_rng(4), 2000, 0.3)
    expected = solve_batch(surface, contacts.force, contacts.moment)
    found = solve_batch(surface, contacts.force, contacts.moment, "newton")
    assert np.all(found.ok)
    error = np.linalg.norm(found.centroid - expected.centroid, axis=1)
    assert np.all(error <= 1e-14 * contacts.relative_condition(found.condition))


def _on_egg(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points on the egg and normals there."""
    points = 0.05 * unit(rng.normal(size=(count, 3)))
    for _ in range(60):
        level = np.array([egg((0.08, 0.05), *row) for row in points])
        points *= (1.0 - level[:, 0] / np.sum(level[:, 1:4] * points, axis=1))[:, None]
    return points, unit(level[:, 1:4])


@pytest.mark.parametrize("torsion", [0.0, 0.3, 10.0])
@pytest.mark.parametrize(
    ("extent", "inner"),
    [
        ((0.08, 0.05, 0.1), (0.0, 0.0, 0.0)),
        ((0.24, 0.15, 0.3), (0.0, 0.0, 0.0)),
        ((0.03, 0.02, 0.03), (0.0, 0.0, 0.0)),
        ((0.3, 0.02, 0.1), (0.03, 0.02, -0.05)),
    ],
)
@pytest.mark.slow
def test_recovers_contacts_on_a_user_defined_body(
    extent: tuple[float, float, float], inner: tuple[float, float, float], torsion: float
) -> None:
    """However roughly its extent and its middle are known."""
    body = Convex(egg, (0.08, 0.05), extent, inner)
    rng = np.random.default_rng(5)
    centroid, normal = _on_egg(rng, 500)
    force = unit(rng.normal(size=(500, 3)))
    force *= -np.sign(np.sum(force * normal, axis=1, keepdims=True))
    moment = np.cross(centroid, force) + 0.1 * torsion * rng.normal(size=(500, 1)) * normal
    found = solve_batch(body, force, moment)
    assert np.all(found.ok)
    error = np.linalg.norm(found.centroid - centroid, axis=1)
    assert np.all(error <= 1e-15 * (10.0 + found.condition))


@pytest.mark.slow
def test_a_user_defined_body_may_be_missed() -> None:
    body = Convex(egg, (0.08, 0.05), (0.08, 0.05, 0.1))
    missed = solve(body, (0.0, 0.0, -1.0), (0.5, 0.0, 0.0))
    assert missed.status == Status.MISS
    assert solve(body, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), "wrench_axis").centroid[2] == pytest.approx(
        solve(body, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0)).centroid[2]
    )
    with pytest.raises(ValueError, match="not negative at the inner point"):
        Convex(egg, (0.08, 0.05), (0.08, 0.05, 0.1), inner=(1.0, 0.0, 0.0))


@pytest.mark.slow
def test_newton_and_closed_form_agree_on_an_ellipsoid() -> None:
    rng = np.random.default_rng(6)
    wrenches = rng.normal(size=(2000, 6)) * (1.0, 1.0, 1.0, 0.1, 0.1, 0.1)
    axes = (0.05, 0.07, 0.1)
    expected = solve_batch(Ellipsoid(*axes), wrenches[:, :3], wrenches[:, 3:])
    steps = []
    size = (ELLIPSOID, *(1.0 / axis for axis in axes), 0.0, 0.0)
    # The start for another body's extent is wrong, so that there is something to iterate.
    body = SmoothBody(size, (0.0, 0.0, 0.0), (0.1, 0.1, 0.1), True)
    for i, w in enumerate(wrenches):
        answer, count = solve_smooth_counted(wrench_of(w[:3], w[3:]), body)
        steps.append(count)
        assert answer.status == Status.OK
        assert np.abs(answer.centroid - expected.centroid[i]).max() < 1e-14 * (10.0 + expected.condition[i])
    # One step, and sometimes one more for rounding.
    assert np.max(steps) <= 2


def test_evaluate_returns_the_derivatives_of_its_value() -> None:
    rng = np.random.default_rng(7)
    for p, q in ((4.0, 4.0), (2.0, 5.0), (3.0, 2.0), (2.5, 2.5)):
        size = Superquadric(0.5, 0.7, 1.0, p, q).problem()[1][0].size
        for point in rng.normal(size=(20, 3)):
            level = np.array(evaluate(size, *point))
            hessian = level[[4, 7, 8, 7, 5, 9, 8, 9, 6]].reshape(3, 3)
            for axis, step in enumerate(1e-6 * np.eye(3)):
                plus, minus = (
                    np.array(evaluate(size, *(point + step))),
                    np.array(evaluate(size, *(point - step))),
                )
                slopes = (plus - minus) / 2e-6
                assert slopes[0] == pytest.approx(level[1 + axis], abs=1e-6)
                np.testing.assert_allclose(
                    slopes[1:4], hessian[axis], atol=1e-5 * (1.0 + np.abs(hessian).max())
                )


@pytest.mark.slow
def test_a_cube_is_a_box() -> None:
    contacts = draw(Box(0.1, 0.04, 0.07, 0.01), np.random.default_rng(8), 2000)
    one = solve_batch(Polytope(CUBE, 0.01), contacts.force, contacts.moment)
    other = solve_batch(Box(0.1, 0.04, 0.07, 0.01), contacts.force, contacts.moment)
    assert np.all(np.abs(one.centroid - other.centroid).max(axis=1) < 1e-15 * (10.0 + one.condition))
    hull = Polytope(CUBE, 0.01).hull
    assert (len(hull.offset), len(hull.length), len(hull.vertex)) == (6, 12, 8)


@pytest.mark.slow
@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize("method", ["exact", "wrench_axis"])
def test_statuses(name: str, method: str) -> None:
    surface = SURFACES[name]
    assert solve(surface, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), method).ok
    missed = solve(surface, (0.0, 0.0, -1.0), (3.0, 0.0, 0.0), method)
    assert missed.status == Status.MISS
    assert np.all(np.isfinite(missed.centroid))
    assert solve(surface, (0.0,) * 3, (1.0,) * 3, method).status == Status.NO_FORCE
    bad = solve(surface, (0.0, np.nan, 1.0), (1.0,) * 3, method)
    assert bad.status == Status.NOT_FINITE


@pytest.mark.slow
@pytest.mark.parametrize("name", SURFACES)
def test_kernels_are_total(name: str) -> None:
    rng = np.random.default_rng(10)
    values = (0.0, -0.0, 5e-324, 1e-300, 1e-150, 1.0, -1.0, 1e150, 1e308, 0.1)
    wrenches = rng.choice(values, size=(3000, 6)) * rng.choice((-1.0, 1.0), size=(3000, 6))
    for method in ("exact", "wrench_axis"):
        found = solve_batch(SURFACES[name], wrenches[:, :3], wrenches[:, 3:], method)
        for values_of in (found.centroid, found.normal, found.torsion, found.residual, found.condition):
            assert not np.any(np.isnan(values_of))


def test_a_superquadric_of_squares_is_an_ellipsoid() -> None:
    contacts = draw(Sphere(0.05), np.random.default_rng(11), 500)
    found = solve_batch(Superquadric(0.05, 0.05, 0.05, 2.0, 2.0), contacts.force, contacts.moment)
    assert np.all(found.ok)
    np.testing.assert_allclose(found.torsion, contacts.torsion, rtol=1e-6, atol=1e-12)
    with pytest.raises(ValueError, match="at least 2"):
        Superquadric(1.0, 1.0, 1.0, 1.5)
