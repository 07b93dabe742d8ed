"""The most probable contact on one primitive is a minimum of the energy, with a calibrated covariance."""

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import minimize

from contactsense.kinematics.wrench_information import to_body_frame
from contactsense.robots import Inertia, Link
from contactsense.robots.primitives import Box, Capsule, Cylinder, Ellipsoid, Primitive, Sphere
from contactsense.robots.surface.convex_primitives import pack, project
from contactsense.solvers.posterior.contact_prior import (
    STUDENT_DOF,
    Contact,
    Prior,
    log_prior,
    pushing_force,
)
from contactsense.solvers.posterior.energy import energy_at, inflate_by_surface_deviation
from contactsense.solvers.posterior.mode import ENERGY_CUTOFF, ENERGY_TOLERANCE, Mode
from contactsense.solvers.wrench import wrench_of
from tests.contactsense.solvers.one_lane import enter_surface, posterior_mode

SHAPES: tuple[Primitive, ...] = (
    Sphere(center=(0, 0, 0), radius=0.05),
    Capsule(a=(0, 0, -0.2), b=(0, 0, 0.2), radius=0.05),
    Cylinder(a=(0, 0, -0.1), b=(0, 0, 0.1), radius_a=0.06, radius_b=0.05, rounding=0.01),
    Ellipsoid(center=(0, 0, 0), radii=(0.1, 0.06, 0.05)),
    Box(center=(0, 0, 0), half=(0.1, 0.06, 0.05), rounding=0.02),
)
PRIOR = Prior(
    friction_ratio=0.25,
    torsion_lever=0.0025,
    surface_deviation=0.0,
    force=20.0,
    clearance=0.005,
    area=1.0,
    log_link_density=np.zeros(1),
)


def _contact(rng: np.random.Generator, kind: int, size: np.ndarray) -> tuple[np.ndarray, ...]:
    """A point on the surface, its normal, and a pushing force and torsion drawn from the prior."""
    while True:
        d, *projected = project(kind, size, *(rng.standard_normal(3) * 0.3))
        if d > 0.0:
            break
    point, normal = np.array(projected[:3]), np.array(projected[3:])
    normal_force = rng.uniform(10.0, 30.0)
    tangential = np.cross(normal, rng.standard_normal(3))
    # Student's distribution in two dimensions: normal over the root of chi-square per degree of freedom.
    radius = np.hypot(*rng.standard_normal(2)) / np.sqrt(rng.chisquare(STUDENT_DOF) / STUDENT_DOF)
    tangential *= normal_force * PRIOR.friction_ratio * radius / np.linalg.norm(tangential)
    return (
        point,
        normal,
        tangential - normal_force * normal,
        PRIOR.torsion_lever * normal_force * rng.standard_normal(),
    )


def _search(
    shape: Primitive, wrench: np.ndarray, information: np.ndarray, prior: Prior
) -> tuple[Mode, int, np.ndarray]:
    surfaces = pack([Link("one", Inertia(1.0, np.zeros(3), np.eye(3)), (shape,))])
    kind, size = surfaces.kind[0], surfaces.size[0]
    R, o = surfaces.rotation[0], surfaces.origin[0]
    w, L = np.empty(6), np.empty((6, 6))
    to_body_frame(wrench, information, R, o, w, L)
    measured = wrench_of(w[:3], w[3:])
    _, point, normal = enter_surface(kind, size, measured)
    start = Contact(point, normal, pushing_force(measured.force, normal), 0.0)
    return posterior_mode(kind, size, w, L, prior, start), kind, size


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.kind)
def test_exact_measurements_recover_the_contact(shape: Primitive) -> None:
    rng = np.random.default_rng(1)
    surfaces = pack([Link("one", Inertia(1.0, np.zeros(3), np.eye(3)), (shape,))])
    information = np.diag([1e8] * 3 + [1e10] * 3)
    for _ in range(50):
        point, normal, force, xi = _contact(rng, surfaces.kind[0], surfaces.size[0])
        wrench = np.concatenate((force, np.cross(point, force) + xi * normal))
        R, o = surfaces.rotation[0], surfaces.origin[0]
        base = np.concatenate((R @ force, R @ wrench[3:] + np.cross(o, R @ force)))
        result = _search(shape, base, information, PRIOR)[0]
        np.testing.assert_allclose(result.contact.point, point, atol=2e-5)
        np.testing.assert_allclose(result.contact.normal, normal, atol=1e-2)
        np.testing.assert_allclose(result.contact.force, force, atol=1e-2)
        assert result.contact.torsion == pytest.approx(xi, abs=1e-3)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.kind)
def test_the_result_is_a_local_minimum(shape: Primitive) -> None:
    """A derivative-free search from the result improves by no more than the tolerance."""
    rng = np.random.default_rng(2)
    surfaces = pack([Link("one", Inertia(1.0, np.zeros(3), np.eye(3)), (shape,))])
    information = np.linalg.inv(np.diag([0.25**2] * 3 + [0.05**2] * 3))
    improvements = []
    for _ in range(12):
        point, normal, force, xi = _contact(rng, surfaces.kind[0], surfaces.size[0])
        wrench = np.concatenate((force, np.cross(point, force) + xi * normal))
        wrench += rng.standard_normal(6) * np.array([0.25] * 3 + [0.05] * 3)
        result, kind, size = _search(shape, wrench, information, PRIOR)
        R, o = surfaces.rotation[0], surfaces.origin[0]
        w, L = np.empty(6), np.empty((6, 6))
        to_body_frame(wrench, information, R, o, w, L)
        found = result.contact
        start = np.array((*found.point, *found.force, found.torsion))
        step = np.array([0.003] * 3 + [0.3] * 3 + [0.02])

        def energy(
            x: np.ndarray,
            w: np.ndarray = w,
            L: np.ndarray = L,
            kind: int = kind,
            size: np.ndarray = size,
            start: np.ndarray = start,
            step: np.ndarray = step,
        ) -> float:
            projected = project(kind, size, *(start[:3] + x[:3] * step[:3]))[1:]
            *force, torsion = (start + x * step)[3:].tolist()
            trial = Contact(projected[:3], projected[3:], tuple(force), torsion)
            inflation = inflate_by_surface_deviation(L, PRIOR, trial)
            return float(energy_at(w, L, PRIOR, inflation, trial))

        best = minimize(
            energy, np.zeros(7), method="Nelder-Mead", options={"maxiter": 4000, "xatol": 1e-4, "fatol": 1e-6}
        )
        improvements.append(result.energy - best.fun)
    assert max(improvements) < 4 * ENERGY_TOLERANCE


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES[:4], ids=lambda shape: shape.kind)
def test_the_covariance_agrees_with_the_errors(shape: Primitive) -> None:
    """Squared errors in units of the stated covariance average two, the number of surface coordinates."""
    rng = np.random.default_rng(3)
    noise = np.array([0.05] * 3 + [0.01] * 3)
    surfaces = pack([Link("one", Inertia(1.0, np.zeros(3), np.eye(3)), (shape,))])
    R, o = surfaces.rotation[0], surfaces.origin[0]
    squares = []
    for _ in range(1500):
        point, normal, force, xi = _contact(rng, surfaces.kind[0], surfaces.size[0])
        wrench = np.concatenate(
            (R @ force, R @ (np.cross(point, force) + xi * normal) + np.cross(o, R @ force))
        )
        wrench += noise * rng.standard_normal(6)
        result, _, _ = _search(shape, wrench, np.diag(noise**-2.0), PRIOR)
        error = np.array(result.tangents) @ (np.array(result.contact.point) - point)
        v11, v12, v22 = result.variances
        squares.append(error @ np.linalg.solve([[v11, v12], [v12, v22]], error))
    # A chi-square of two degrees of freedom: the median is 2 ln 2 and 90 % lie below 4.61.
    assert np.median(squares) == pytest.approx(2 * np.log(2), rel=0.15)
    assert np.mean(np.array(squares) < 4.605) == pytest.approx(0.9, abs=0.03)


def test_the_wrench_is_transformed_between_frames() -> None:
    rng = np.random.default_rng(4)
    root = rng.standard_normal((6, 6))
    information = root @ root.T
    rotation = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    origin, wrench = rng.standard_normal(3), rng.standard_normal(6)
    w, L = np.empty(6), np.empty((6, 6))
    to_body_frame(wrench, information, rotation, origin, w, L)
    x, y, z = origin
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    to_base = np.block([[rotation, np.zeros((3, 3))], [cross @ rotation, rotation]])
    np.testing.assert_allclose(to_base @ w, wrench, atol=1e-13)
    np.testing.assert_allclose(L, to_base.T @ information @ to_base, atol=1e-12)


def test_the_surface_deviation_adds_to_the_covariance() -> None:
    rng = np.random.default_rng(5)
    information = np.linalg.inv(np.diag([0.1] * 3 + [0.02] * 3))
    wrench, n, f = rng.standard_normal(6), np.array([0.0, 0.6, 0.8]), np.array([3.0, -5.0, -8.0])
    c, xi, prior = np.array([0.1, 0.2, 0.05]), 0.02, PRIOR._replace(surface_deviation=0.004)
    u = np.concatenate((np.zeros(3), np.cross(n, f)))
    covariance = np.linalg.inv(information) + prior.surface_deviation**2 * np.outer(u, u)
    d = np.concatenate((f, np.cross(c, f) + xi * n)) - wrench
    normal_force = -f @ n
    expected = (
        0.5 * d @ np.linalg.solve(covariance, d) + 0.5 * (xi / (prior.torsion_lever * normal_force)) ** 2
    )
    squared_ratio = (f @ f - normal_force**2) / (prior.friction_ratio * normal_force) ** 2
    expected += (
        0.5 * (STUDENT_DOF + 2) * np.log(1 + squared_ratio / STUDENT_DOF)
        + 0.5 * np.log(normal_force / prior.force) ** 2
        + 4 * np.log(normal_force / np.linalg.norm(f))
    )
    contact = Contact(tuple(c.tolist()), tuple(n.tolist()), tuple(f.tolist()), float(xi))
    inflation = inflate_by_surface_deviation(information, prior, contact)
    energy, variance_ratio = energy_at(wrench, information, prior, inflation, contact), inflation[2]
    assert energy == pytest.approx(expected, rel=1e-12)
    assert variance_ratio == pytest.approx(np.linalg.det(covariance) * np.linalg.det(information), rel=1e-10)


def test_the_energy_is_that_of_the_density_of_force_and_torsion() -> None:
    """The priors are densities of log F, f_t / F and xi / F; the search moves f and xi."""
    rng = np.random.default_rng(6)
    differences = []
    for _ in range(50):
        normal = rng.standard_normal(3)
        normal /= np.linalg.norm(normal)
        force, xi = rng.standard_normal(3) * 20.0, 0.05 * rng.standard_normal()
        F = -force @ normal
        if F <= 0.0:
            continue
        ratio = force / F + normal
        log_density = stats.lognorm(1.0, scale=PRIOR.force).logpdf(F)
        scale = PRIOR.friction_ratio**2 * np.eye(2)
        tangents = np.linalg.svd(normal[None])[2][1:]
        log_density += stats.multivariate_t(shape=scale, df=STUDENT_DOF).logpdf(
            tangents @ ratio
        ) - 2 * np.log(F)
        log_density += stats.norm(scale=PRIOR.torsion_lever * F).logpdf(xi)
        contact = Contact((0.0, 0.0, 0.0), tuple(normal.tolist()), tuple(force.tolist()), xi)
        unmeasured = np.zeros((6, 6))
        inflation = inflate_by_surface_deviation(unmeasured, PRIOR, contact)
        energy = energy_at(np.zeros(6), unmeasured, PRIOR, inflation, contact)
        differences.append(log_prior(PRIOR, float(np.linalg.norm(force))) - energy - log_density)
    assert len(differences) > 10
    np.testing.assert_allclose(differences, 3.0 * np.log(2.0 * np.pi), rtol=1e-9)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.kind)
def test_degenerate_wrenches_return_finite_numbers(shape: Primitive) -> None:
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
            found = _search(shape, wrench, scale * np.eye(6), PRIOR)[0]
            point, normal, force, torsion = found.contact
            assert np.isfinite((*point, *normal, *force, torsion, *found.variances)).all()
            assert not np.isnan((found.energy, found.log_evidence)).any()
    assert ENERGY_CUTOFF > 0.0
