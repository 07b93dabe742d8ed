"""`solve` with a covariance: exact wrenches, the localization's search, stated errors, frames and units."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from contactsense.robots.surface.convex_primitives import BOX, ELLIPSOID, REVOLVED
from contactsense.solvers import (
    Box,
    Capsule,
    Cone,
    ContactPrior,
    Cylinder,
    Ellipsoid,
    Fingertip,
    Paraboloid,
    Placed,
    Plane,
    ProbableContact,
    Revolved,
    Sphere,
    Status,
    Superquadric,
    Surface,
    TaperedCapsule,
    solve,
)
from contactsense.solvers.posterior.contact_prior import STUDENT_DOF, Contact, Prior, pushing_force
from contactsense.solvers.wrench import wrench_of
from tests.contactsense.solvers.one_lane import enter_surface, posterior_mode

PRIOR = ContactPrior()
EXACT = np.diag([1e-8] * 3 + [1e-11] * 3)
NOISE = np.diag([0.25**2] * 3 + [0.02**2] * 3)
PACKED: tuple[tuple[Surface, int, tuple[float, ...]], ...] = (
    (Sphere(0.05), REVOLVED, (0.0, 0.0, 0.0, 0.05)),
    (Capsule(0.2, 0.05), REVOLVED, (0.2, 0.0, 0.0, 0.05)),
    (Revolved(0.1, 0.05, 0.04, 0.01), REVOLVED, (0.1, 0.05, 0.04, 0.01)),
    (Ellipsoid(0.1, 0.06, 0.05), ELLIPSOID, (0.1, 0.06, 0.05, 0.0)),
    (Box(0.08, 0.04, 0.03, 0.02), BOX, (0.08, 0.04, 0.03, 0.02)),
)
SURFACES: tuple[Surface, ...] = (
    *(surface for surface, _, _ in PACKED),
    Cylinder(0.05),
    TaperedCapsule(0.15, 0.05, 0.03),
    Fingertip(0.01),
    Superquadric(0.1, 0.06, 0.05, 4.0, 3.0),
)


def draw(surface: Surface, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Centroid and wrench of a push with friction and torsion, from the prior, where some line enters."""
    while True:
        aim = rng.standard_normal(3) * 0.3 * np.array([0.05, 0.05, 0.1])
        direction = rng.standard_normal(3)
        entry = solve(surface, direction, np.cross(aim, direction), "wrench_axis")
        if not entry.ok:
            continue
        c, n = entry.centroid, entry.normal
        F = rng.uniform(10.0, 30.0)
        across = np.cross(n, rng.standard_normal(3))
        radius = np.hypot(*rng.standard_normal(2)) / np.sqrt(rng.chisquare(STUDENT_DOF) / STUDENT_DOF)
        f = F * (0.5 * PRIOR.friction * radius * across / np.linalg.norm(across) - n)
        w = np.concatenate((f, np.cross(c, f) + PRIOR.torsion * F * rng.standard_normal() * n))
        if np.linalg.norm(solve(surface, w[:3], w[3:]).centroid - c) < 1e-9:
            return c, w


@pytest.mark.slow
@pytest.mark.parametrize("surface", SURFACES, ids=lambda surface: type(surface).__name__)
def test_an_exact_wrench_has_the_exact_contact(surface: Surface) -> None:
    rng = np.random.default_rng(1)
    for _ in range(10):
        c, w = draw(surface, rng)
        found = solve(surface, w[:3], w[3:], covariance=EXACT)
        exact = solve(surface, w[:3], w[3:])
        assert found.ok
        np.testing.assert_allclose(found.centroid, c, atol=2e-6)
        np.testing.assert_allclose(found.force, w[:3], atol=1e-3)
        assert found.torsion == pytest.approx(exact.torsion, abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("surface", "kind", "size"), PACKED, ids=lambda value: type(value).__name__)
def test_it_is_the_mode_that_the_localization_finds(
    surface: Surface, kind: int, size: tuple[float, ...]
) -> None:
    """The localization's search on a primitive stops a tenth of a standard deviation before the mode."""
    rng = np.random.default_rng(2)
    packed = np.array((*size, 0.0, 0.0, 0.0, 0.0))
    prior = Prior(PRIOR.friction / 2.0, PRIOR.torsion, 0.0, PRIOR.force, 0.0, 1.0, np.zeros(1))
    for _ in range(15):
        w = draw(surface, rng)[1] + rng.standard_normal(6) * np.sqrt(np.diag(NOISE))
        found = solve(surface, w[:3], w[3:], covariance=NOISE)
        measured = wrench_of(w[:3], w[3:])
        _, point, normal = enter_surface(kind, packed, measured)
        start = Contact(point, normal, pushing_force(measured.force, normal), 0.0)
        theirs = posterior_mode(kind, packed, w, np.linalg.inv(NOISE), prior, start)
        assert found.energy <= theirs.energy + 1e-6
        if found.energy > theirs.energy - 0.02:
            shift = found.centroid - theirs.contact.point
            assert np.linalg.norm(shift) < 0.5 * np.sqrt(np.trace(found.covariance))
            assert found.log_evidence == pytest.approx(theirs.log_evidence, abs=0.2)


@pytest.mark.parametrize(
    "surface", [Sphere(0.05), Ellipsoid(0.1, 0.06, 0.05), TaperedCapsule(0.15, 0.05, 0.03)]
)
def test_the_stated_covariance_is_that_of_the_errors(surface: Surface) -> None:
    rng = np.random.default_rng(3)
    count, inside = 120, 0
    for _ in range(count):
        c, w = draw(surface, rng)
        w = w + rng.standard_normal(6) * np.sqrt(np.diag(NOISE))
        found = solve(surface, w[:3], w[3:], covariance=NOISE)
        error = found.centroid - c
        inside += bool(error @ np.linalg.pinv(found.covariance, rcond=1e-6) @ error < chi2.ppf(0.9, 2))
    # Three standard deviations of a binomial with 0.9.
    assert abs(inside / count - 0.9) < 3.0 * np.sqrt(0.09 / count)


@pytest.mark.parametrize("surface", SURFACES, ids=lambda surface: type(surface).__name__)
def test_no_contact_nearby_is_more_probable(surface: Surface) -> None:
    rng = np.random.default_rng(4)
    w = draw(surface, rng)[1] + rng.standard_normal(6) * np.sqrt(np.diag(NOISE))
    found = solve(surface, w[:3], w[3:], covariance=NOISE)
    for _ in range(30):
        f = found.force + 0.05 * rng.standard_normal(3)
        beside = found.centroid + 0.001 * rng.standard_normal(3)
        other = solve(surface, f, np.cross(beside, f) + found.torsion * found.normal)
        assert not other.ok or energy(other, w, NOISE) >= found.energy - 1e-9


def energy(contact: Any, w: np.ndarray, covariance: np.ndarray) -> float:
    """The negative log posterior, written out (`contactsense.solvers.posterior.equations`)."""
    e = np.concatenate((contact.force, contact.moment)) - w
    F = -contact.force @ contact.normal
    across = np.linalg.norm(contact.force + F * contact.normal)
    ratio = across / (0.5 * PRIOR.friction * F)
    return float(
        0.5 * e @ np.linalg.solve(covariance, e)
        + 0.5 * (contact.torsion / (PRIOR.torsion * F)) ** 2
        + 0.5 * (STUDENT_DOF + 2.0) * np.log1p(ratio**2 / STUDENT_DOF)
        + 0.5 * np.log(F / PRIOR.force) ** 2
    )


def moved(found: ProbableContact, R: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, ...]:
    centroid, covariance = p + R @ found.centroid, R @ found.covariance @ R.T
    return centroid, R @ found.normal, R @ found.force, covariance, np.array(found.energy)


def test_a_placed_surface_is_the_surface_in_another_frame() -> None:
    rng = np.random.default_rng(5)
    surface = Ellipsoid(0.1, 0.06, 0.05)
    R, p = Rotation.random(rng=rng).as_matrix(), rng.standard_normal(3)
    w = draw(surface, rng)[1] + rng.standard_normal(6) * np.sqrt(np.diag(NOISE))
    f = R @ w[:3]
    turn = np.zeros((6, 6))
    turn[:3, :3] = turn[3:, 3:] = R
    turn[3:, :3] = np.cross(p, R.T).T
    np.testing.assert_allclose(turn @ w, np.concatenate((f, R @ w[3:] + np.cross(p, f))), atol=1e-12)
    placed = solve(Placed(surface, p, R), f, (turn @ w)[3:], covariance=turn @ NOISE @ turn.T)
    given = solve(surface, w[:3], w[3:], covariance=NOISE)
    theirs = (placed.centroid, placed.normal, placed.force, placed.covariance, np.array(placed.energy))
    for one, other in zip(moved(given, R, p), theirs, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-8)


def test_units_of_length_and_force_do_not_matter() -> None:
    rng = np.random.default_rng(6)
    w = draw(Ellipsoid(0.1, 0.06, 0.05), rng)[1] + rng.standard_normal(6) * np.sqrt(np.diag(NOISE))
    metres = solve(Ellipsoid(0.1, 0.06, 0.05), w[:3], w[3:], covariance=NOISE)
    length, force = 1e3, 1e-3
    scale = np.diag([force] * 3 + [force * length] * 3)
    scaled = solve(
        Ellipsoid(100.0, 60.0, 50.0),
        force * w[:3],
        force * length * w[3:],
        covariance=scale @ NOISE @ scale,
        prior=ContactPrior(torsion=PRIOR.torsion * length, force=PRIOR.force * force),
    )
    np.testing.assert_allclose(scaled.centroid, length * metres.centroid, rtol=1e-6)
    np.testing.assert_allclose(scaled.covariance, length**2 * metres.covariance, rtol=1e-4, atol=1e-3)
    assert scaled.energy == pytest.approx(metres.energy, rel=1e-9)


def test_a_line_that_misses_by_noise_touches_the_rim() -> None:
    """5 mm beside a sphere; 20 N and 0.1 Nm of noise: 5 mm are one standard deviation."""
    noise = np.diag([0.25**2] * 3 + [0.1**2] * 3)
    f = np.array([0.0, 0.0, -20.0])
    m = np.cross([0.055, 0.0, 0.0], f)
    assert solve(Sphere(0.05), f, m).status == Status.MISS
    found = solve(Sphere(0.05), f, m, covariance=noise)
    assert found.ok
    assert found.centroid[0] > 0.03
    assert abs(found.centroid[1]) < 1e-6
    assert found.force @ found.normal < 0.0
    farther = solve(Sphere(0.05), f, 3.0 * m, covariance=noise)
    assert farther.energy > found.energy + 10.0


@pytest.mark.parametrize(
    "surface",
    [
        Cylinder(0.05),
        Cone(0.05, 0.3),
        Plane((0.0, 0.0, 1.0), 0.02),
        Paraboloid(5.0, 10.0, 0.05),
        Sphere(0.05),
    ],
    ids=lambda surface: type(surface).__name__,
)
@pytest.mark.parametrize("size", [1e-300, 1e-12, 1e-3])
def test_a_force_far_below_its_noise_has_a_mode(surface: Surface, size: float) -> None:
    """Its line passes kilometres away, where the search began and ended."""
    rng = np.random.default_rng(7)
    for _ in range(4):
        f, m = size * rng.standard_normal(3), 0.01 * rng.standard_normal(3)
        found = solve(surface, f, m, covariance=NOISE)
        assert found.ok
        assert 0.0 < found.energy < 40.0
        assert np.isfinite(found.log_evidence)
        assert np.linalg.eigvalsh(found.covariance)[1] > 1e-6
        assert found.force @ found.normal < 0.0


@pytest.mark.parametrize(
    ("force", "moment", "status"),
    [
        ((0.0, 0.0, 0.0), (0.1, 0.0, 0.0), Status.NO_FORCE),
        ((0.0, np.nan, 1.0), (0.1, 0.0, 0.0), Status.NOT_FINITE),
        ((0.0, np.inf, 1.0), (0.1, 0.0, 0.0), Status.NOT_FINITE),
    ],
)
def test_a_wrench_without_a_contact_says_why(
    force: tuple[float, ...], moment: tuple[float, ...], status: Status
) -> None:
    found = solve(Sphere(0.05), force, moment, covariance=NOISE)
    assert (found.status, found.ok) == (status, False)
    assert np.isinf(found.energy)


def _asymmetric() -> np.ndarray:
    P = NOISE.copy()
    P[0, 1] = 0.01
    return P


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"covariance": np.eye(3)}, r"covariance: expected shape \(6, 6\), not \(3, 3\)"),
        ({"covariance": -NOISE}, "covariance: must be positive definite"),
        ({"covariance": _asymmetric()}, "covariance: must be finite and symmetric"),
        ({"covariance": np.full((6, 6), np.nan)}, "covariance: must be finite and symmetric"),
        ({"covariance": NOISE, "method": "newton"}, "method: with a covariance only 'exact', not 'newton'"),
        ({"prior": PRIOR}, "prior: only with a covariance"),
    ],
)
def test_arguments_that_cannot_be(arguments: dict[str, Any], message: str) -> None:
    call: Callable[..., object] = solve
    with pytest.raises(ValueError, match=message):
        call(Sphere(0.05), (0, 0, -1), (0, 0, 0), **arguments)


@pytest.mark.parametrize("field", ["friction", "torsion", "force", "surface_error"])
def test_a_prior_that_cannot_be(field: str) -> None:
    with pytest.raises(ValueError, match=f"{field}: must"):
        ContactPrior(**{field: -1.0})
    with pytest.raises(ValueError, match=f"{field}: must"):
        ContactPrior(**{field: np.nan})
