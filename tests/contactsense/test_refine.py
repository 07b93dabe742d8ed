"""The most probable contact on one primitive: a minimum, with a covariance that is true."""

import numpy as np
import pytest
from scipy.optimize import minimize

from contactsense.energy import TAIL, Prior, empty_work, energy_at, lean_in, loosen
from contactsense.refine import CUT, ENOUGH, refine
from contactsense.seed import enter
from contactsense.view import view
from robots import Inertia, Link
from robots.primitives import Box, Capsule, Cylinder, Ellipsoid, Primitive, Sphere
from robots.surface import pack, project

SHAPES: tuple[Primitive, ...] = (
    Sphere(center=(0, 0, 0), radius=0.05),
    Capsule(a=(0, 0, -0.2), b=(0, 0, 0.2), radius=0.05),
    Cylinder(a=(0, 0, -0.1), b=(0, 0, 0.1), radius_a=0.06, radius_b=0.05, rounding=0.01),
    Ellipsoid(center=(0, 0, 0), radii=(0.1, 0.06, 0.05)),
    Box(center=(0, 0, 0), half=(0.1, 0.06, 0.05), rounding=0.02),
)
PRIOR = Prior(lean=0.25, lever=0.0025, offset=0.0, force=20.0, room=0.005, area=1.0)
FAR = 1e9


def _contact(chance: np.random.Generator, kind: int, size: np.ndarray) -> tuple[np.ndarray, ...]:
    """A place on the surface, its normal, a push there as force and torsion drawn from the prior."""
    while True:
        d, *rest = project(kind, size, *(chance.standard_normal(3) * 0.3))
        if d > 0.0:
            break
    point, normal = np.array(rest[:3]), np.array(rest[3:])
    push = chance.uniform(10.0, 30.0)
    lean = np.cross(normal, chance.standard_normal(3))
    # Student's distribution in two dimensions: normal over the root of chi-square per degree of freedom.
    far = np.hypot(*chance.standard_normal(2)) / np.sqrt(chance.chisquare(TAIL) / TAIL)
    lean *= push * PRIOR.lean * far / np.linalg.norm(lean)
    return point, normal, lean - push * normal, PRIOR.lever * push * chance.standard_normal()


def _search(shape: Primitive, wrench: np.ndarray, information: np.ndarray, prior: Prior):  # type: ignore[no-untyped-def]
    surfaces = pack([Link("one", Inertia(1.0, np.zeros(3), np.eye(3)), (shape,))])
    work = empty_work()
    kind, size = surfaces.kind[0], surfaces.size[0]
    R, o = surfaces.rotation[0], surfaces.origin[0]
    w, L = np.empty(6), np.empty((6, 6))
    view(wrench, information, R, o, w, L)
    seed = enter(kind, size, surfaces.radius[0], *w)[1:]
    force = lean_in(*w[:3], *seed[3:])
    return refine(kind, size, w, L, prior, FAR, *seed, *force, 0.0, work), work, kind, size


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.kind)
def test_exact_measurements_give_the_constructed_contact_back(shape: Primitive) -> None:
    chance = np.random.default_rng(1)
    surfaces = pack([Link("one", Inertia(1.0, np.zeros(3), np.eye(3)), (shape,))])
    information = np.diag([1e8] * 3 + [1e10] * 3)
    for _ in range(50):
        point, normal, force, xi = _contact(chance, surfaces.kind[0], surfaces.size[0])
        wrench = np.concatenate((force, np.cross(point, force) + xi * normal))
        R, o = surfaces.rotation[0], surfaces.origin[0]
        base = np.concatenate((R @ force, R @ wrench[3:] + np.cross(o, R @ force)))
        result = _search(shape, base, information, PRIOR)[0]
        np.testing.assert_allclose(result[2:5], point, atol=2e-5)
        np.testing.assert_allclose(result[5:8], normal, atol=1e-2)
        np.testing.assert_allclose(result[8:11], force, atol=1e-2)
        assert result[11] == pytest.approx(xi, abs=1e-3)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.kind)
def test_no_better_place_is_near(shape: Primitive) -> None:
    """A derivative-free search from the result gains no more than the search's own threshold."""
    chance = np.random.default_rng(2)
    surfaces = pack([Link("one", Inertia(1.0, np.zeros(3), np.eye(3)), (shape,))])
    information = np.linalg.inv(np.diag([0.25**2] * 3 + [0.05**2] * 3))
    gains = []
    for _ in range(12):
        point, normal, force, xi = _contact(chance, surfaces.kind[0], surfaces.size[0])
        wrench = np.concatenate((force, np.cross(point, force) + xi * normal))
        wrench += chance.standard_normal(6) * np.array([0.25] * 3 + [0.05] * 3)
        result, _, kind, size = _search(shape, wrench, information, PRIOR)
        R, o = surfaces.rotation[0], surfaces.origin[0]
        w, L = np.empty(6), np.empty((6, 6))
        view(wrench, information, R, o, w, L)
        start = np.concatenate((result[2:5], result[8:11], [result[11]]))
        step = np.array([0.003] * 3 + [0.3] * 3 + [0.02])

        def energy(x, w=w, L=L, kind=kind, size=size, start=start, step=step):  # type: ignore[no-untyped-def]
            place = project(kind, size, *(start[:3] + x[:3] * step[:3]))[1:]
            rest = (start + x * step)[3:]
            loose = loosen(L, PRIOR, *place[3:], *rest[:3])
            return energy_at(w, L, PRIOR, loose, *place, *rest)

        best = minimize(
            energy, np.zeros(7), method="Nelder-Mead", options={"maxiter": 4000, "xatol": 1e-4, "fatol": 1e-6}
        )
        gains.append(result[0] - best.fun)
    assert max(gains) < 4 * ENOUGH


@pytest.mark.parametrize("shape", SHAPES[:4], ids=lambda shape: shape.kind)
def test_the_covariance_is_that_of_the_errors(shape: Primitive) -> None:
    """Squared errors in units of the stated covariance average two, the number of surface coordinates."""
    chance = np.random.default_rng(3)
    noise = np.array([0.05] * 3 + [0.01] * 3)
    surfaces = pack([Link("one", Inertia(1.0, np.zeros(3), np.eye(3)), (shape,))])
    R, o = surfaces.rotation[0], surfaces.origin[0]
    squares = []
    for _ in range(1500):
        point, normal, force, xi = _contact(chance, surfaces.kind[0], surfaces.size[0])
        wrench = np.concatenate(
            (R @ force, R @ (np.cross(point, force) + xi * normal) + np.cross(o, R @ force))
        )
        wrench += noise * chance.standard_normal(6)
        result, work, _, _ = _search(shape, wrench, np.diag(noise**-2.0), PRIOR)
        error = work.frame[:, 1:].T @ (np.array(result[2:5]) - point)
        v11, v12, v22 = result[12:]
        squares.append(error @ np.linalg.solve([[v11, v12], [v12, v22]], error))
    # A chi-square of two degrees of freedom: the median is 2 ln 2 and 90 % lie below 4.61.
    assert np.median(squares) == pytest.approx(2 * np.log(2), rel=0.15)
    assert np.mean(np.array(squares) < 4.605) == pytest.approx(0.9, abs=0.03)


def test_a_view_is_the_same_wrench_from_another_frame() -> None:
    chance = np.random.default_rng(4)
    root = chance.standard_normal((6, 6))
    information = root @ root.T
    rotation = np.linalg.qr(chance.standard_normal((3, 3)))[0]
    origin, wrench = chance.standard_normal(3), chance.standard_normal(6)
    w, L = np.empty(6), np.empty((6, 6))
    view(wrench, information, rotation, origin, w, L)
    x, y, z = origin
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    to_base = np.block([[rotation, np.zeros((3, 3))], [cross @ rotation, rotation]])
    np.testing.assert_allclose(to_base @ w, wrench, atol=1e-13)
    np.testing.assert_allclose(L, to_base.T @ information @ to_base, atol=1e-12)


def test_an_offset_of_the_surface_loosens_the_fit_as_its_covariance_says() -> None:
    chance = np.random.default_rng(5)
    information = np.linalg.inv(np.diag([0.1] * 3 + [0.02] * 3))
    wrench, n, f = chance.standard_normal(6), np.array([0.0, 0.6, 0.8]), np.array([3.0, -5.0, -8.0])
    c, xi, prior = np.array([0.1, 0.2, 0.05]), 0.02, Prior(0.25, 0.0025, 0.004, 20.0, 0.005, 1.0)
    u = np.concatenate((np.zeros(3), np.cross(n, f)))
    covariance = np.linalg.inv(information) + prior.offset**2 * np.outer(u, u)
    d = np.concatenate((f, np.cross(c, f) + xi * n)) - wrench
    push = -f @ n
    expected = 0.5 * d @ np.linalg.solve(covariance, d) + 0.5 * (xi / (prior.lever * push)) ** 2
    lean = (f @ f - push**2) / (prior.lean * push) ** 2
    expected += 0.5 * (TAIL + 2) * np.log(1 + lean / TAIL) + 0.5 * np.log(push / prior.force) ** 2
    loose = loosen(information, prior, *n, *f)
    energy, widen = energy_at(wrench, information, prior, loose, *c, *n, *f, xi), loose[2]
    assert energy == pytest.approx(expected, rel=1e-12)
    assert widen == pytest.approx(np.linalg.det(covariance) * np.linalg.det(information), rel=1e-10)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.kind)
def test_hard_cases_end_with_finite_numbers(shape: Primitive) -> None:
    """No wrench at all, tiny, huge, grazing, parallel to the axis, absurd torsion, tight and loose
    information."""
    wrenches = [
        np.zeros(6),
        np.full(6, 1e-300),
        np.full(6, 1e-9),
        np.array([1e9, -1e9, 1e9, 1e8, 1e8, 1e8]),
        np.array([0.0, 0.0, -20.0, 0.0, 0.0, 0.0]),
        np.array([0.0, 0.0, -20.0, 0.0, 1.0, 0.0]),
        np.array([20.0, 0.0, 0.0, 0.0, 0.0, 1.0]),
        np.array([20.0, 0.0, 0.0, 0.0, 0.0, 1e6]),
        np.array([0.0, 0.0, 0.0, 0.0, 0.0, 5.0]),
        np.array([1.0, 0.0, 0.0, 1e6, 0.0, 0.0]),
    ]
    for wrench in wrenches:
        for scale in (1e-6, 1.0, 1e9):
            result = _search(shape, wrench, scale * np.eye(6), PRIOR)[0]
            assert np.isfinite(result[2:]).all()
            assert not np.isnan(result[:2]).any()
    assert CUT > 0.0
