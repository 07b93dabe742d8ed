"""Statuses follow from signs: of f.m, of the torsion, and of the force along the normal."""

from fractions import Fraction

import numpy as np
import pytest

from contactsense.solvers import (
    Box,
    Capsule,
    Compound,
    Cone,
    Cylinder,
    Ellipsoid,
    Paraboloid,
    Part,
    Placed,
    Plane,
    Polytope,
    Revolved,
    Sphere,
    Status,
    Superquadric,
    Surface,
    TaperedCapsule,
    solve,
    solve_batch,
)
from contactsense.solvers.wrench import invariant, wrench_of
from tests.contactsense.solvers.test_general import CUBE

BODIES: dict[str, Surface] = {
    "sphere": Sphere(0.7),
    "ellipsoid": Ellipsoid(0.3, 0.7, 1.1),
    "capsule": Capsule(0.5, 0.3),
    "tapered capsule": TaperedCapsule(0.5, 0.3, 0.2),
    "cylinder": Revolved(0.5, 0.5, 0.5, 0.1),
    "cone": Revolved(0.5, 0.7, 0.3, 0.1),
    "disc": Revolved(0.0, 0.7, 0.7, 0.1),
    "two discs in one plane": Revolved(0.0, 0.3, 0.7, 0.1),
    "ball on a segment": Revolved(0.5, 0.0, 0.0, 0.3),
    "box": Box(0.5, 0.3, 0.4, 0.1),
    "polytope": Polytope(np.array(CUBE) * 5.0, 0.1),
    "superquadric": Superquadric(1.0, 0.7, 0.5),
    "superquadric, uneven": Superquadric(1.0, 0.7, 0.5, 4.0, 2.5),
}
"""All within 1.2 of the origin."""


def passing_by(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Forces, moments and points of lines 1.8 or more from the origin, all exact in floating point."""
    rng = np.random.default_rng(1)
    force = rng.integers(-8, 9, (20 * count, 3)).astype(float)
    point = rng.integers(-40, 41, force.shape) / 8.0
    moment = np.cross(point, force)
    by = np.linalg.norm(moment, axis=1) >= 1.8 * np.linalg.norm(force, axis=1)
    by &= np.any(force != 0.0, axis=1)
    return force[by][:count], moment[by][:count], point[by][:count]


@pytest.mark.parametrize("name", BODIES)
def test_a_pure_force_that_passes_by_misses(name: str) -> None:
    force, moment, _ = passing_by(300)
    found = solve_batch(BODIES[name], force, moment)
    assert set(found.status.tolist()) == {Status.MISS}


@pytest.mark.parametrize(
    "surface",
    [Superquadric(1.0, 0.7, 0.5, 64.0, 64.0), BODIES["box"], BODIES["polytope"]],
    ids=["nearly a box", "box", "polytope"],
)
def test_a_pure_force_along_a_flat_that_passes_by_misses(surface: Surface) -> None:
    """Where the flat is plane to the last digit, any torsion there balances a force along it."""
    rng = np.random.default_rng(3)
    for axis in range(3):
        force = np.zeros((1000, 3))
        force[:, axis] = rng.choice((-3.0, 3.0), size=len(force))
        point = rng.uniform(-4.0, 4.0, force.shape)
        point = point[np.delete(np.abs(point), axis, axis=1).max(axis=1) > 1.2]
        moment = np.cross(point, force[: len(point)])
        found = solve_batch(surface, force[: len(point)], moment)
        assert set(found.status.tolist()) == {Status.MISS}


def turned() -> tuple[np.ndarray, np.ndarray]:
    """A pose in which no number is exact."""
    axes, _ = np.linalg.qr(np.random.default_rng(6).normal(size=(3, 3)))
    return np.array((0.03, -0.02, 0.05)), axes * np.linalg.det(axes)


@pytest.mark.parametrize("name", BODIES)
def test_a_pure_force_that_passes_by_a_placed_body_misses(name: str) -> None:
    """Rounding in the body's frame makes no torsion of it."""
    body = Placed(BODIES[name], *turned())
    force, moment, _ = passing_by(300)
    found = solve_batch(body, force, moment)
    assert set(found.status.tolist()) == {Status.MISS}
    one = solve(body, force[0], moment[0])
    assert (one.status, one.method) == (Status.MISS, "exact")
    # In any unit: the product of these forces and moments is below the range of floats.
    small = 2.0**-600
    assert np.all(solve_batch(body, small * force, small * (moment + 1e-3 * force)).ok)


def test_a_pure_force_that_passes_by_placed_parts_misses() -> None:
    origin, axes = turned()
    cylinder = Placed(Cylinder(0.5), origin, axes)
    ends = [Placed(Plane((0.0, 0.0, sign), 0.8), origin, axes) for sign in (1.0, -1.0)]
    tip = Part(Placed(Sphere(0.5), origin, axes), (Placed(Plane((0.0, 0.0, -1.0), 0.0), origin, axes),))
    shaft = Part(cylinder, (Placed(Plane((0.0, 0.0, 1.0), 0.0), origin, axes), ends[1]))
    force, moment, _ = passing_by(300)
    for body in (Compound.common([cylinder, *ends], 1.0), Compound([tip, shaft], 1.0)):
        assert set(solve_batch(body, force, moment).status.tolist()) == {Status.MISS}


@pytest.mark.parametrize("name", BODIES)
def test_the_torsion_balances_the_push_in_sign(name: str) -> None:
    """f.m = xi (f.n) and f.n < 0: never the twin that pulls, however small f.m is."""
    force, moment, _ = passing_by(300)
    rng = np.random.default_rng(2)
    for size in (1e-12, 1e-8, 1.0):
        twisted = moment + size * rng.choice((-1.0, 1.0), size=(len(force), 1)) * force
        found = solve_batch(BODIES[name], force, twisted)
        assert np.all(found.ok)
        exact = [
            sum((Fraction(a) * Fraction(b) for a, b in zip(f, m, strict=True)), Fraction(0))
            for f, m in zip(force.tolist(), twisted.tolist(), strict=True)
        ]
        for t, xi in zip(exact, found.torsion, strict=True):
            assert (t > 0) == (xi < 0.0)


def test_the_invariant_has_the_right_sign_where_its_terms_cancel() -> None:
    rng = np.random.default_rng(3)
    for force, point in zip(rng.normal(size=(2000, 3)), rng.normal(size=(2000, 3)), strict=True):
        moment = np.cross(point, force)
        exact = sum(
            (Fraction(a) * Fraction(b) for a, b in zip(force.tolist(), moment.tolist(), strict=True)),
            Fraction(0),
        )
        assert invariant(wrench_of(force, moment)) == pytest.approx(float(exact), rel=1e-14, abs=1e-30)


def test_an_apex_is_sharp() -> None:
    for cone, apex, into in ((Cone(0.1, 0.2), 0.5, -1.0), (Cone(0.1, -3.0), -0.1 / 3.0, 1.0)):
        at = np.array((0.0, 0.0, apex))
        force = np.array((0.05, -0.02, 2.0 * into))
        entering = solve(cone, force, np.cross(at, force))
        assert entering.status == Status.SHARP
        np.testing.assert_allclose(entering.centroid, at, atol=1e-16)
        assert solve(cone, force, np.cross(at, force), "wrench_axis").ok
        twisted = solve(cone, force, np.cross(at, force) + np.array((0.0, 0.0, 0.03)))
        assert twisted.status == Status.SHARP
        assert twisted.torsion == pytest.approx(-0.03 * into)
        leaving = solve(cone, -force, -np.cross(at, force))
        assert leaving.status != Status.SHARP
        assert not leaving.ok


def test_a_torsion_on_a_corner_is_sharp_and_a_line_beside_misses() -> None:
    half = np.array((0.1, 0.04, 0.07))
    force = np.array((-1.0, -2.0, -3.0))
    for body in (Polytope(CUBE, 0.0), Box(*half.tolist(), 0.0)):
        inside = half - 1e-4
        found = solve(body, force, np.cross(inside, force) + 0.001 * np.array((1.0, 1.0, 1.0)))
        assert found.status == Status.SHARP
        np.testing.assert_allclose(found.centroid, half, atol=2e-3)
        beside = solve(body, force, np.cross((0.5, 0.5, -0.5), force))
        assert beside.status == Status.MISS


@pytest.mark.parametrize("rounding", [1e-7, 1e-9, 1e-12])
def test_a_nearly_sharp_rim_converges(rounding: float) -> None:
    """Contacts on the rim, any pushing force, torsions that turn the edge's two solutions into one."""
    drum = Revolved(0.1, 0.05, 0.05, rounding)
    rng = np.random.default_rng(4)
    count = 5000
    around, up = rng.uniform(0.0, 2.0 * np.pi, count), rng.uniform(0.05, 0.5 * np.pi - 0.05, count)
    e = np.column_stack((np.cos(around), np.sin(around), np.zeros(count)))
    n = np.cos(up)[:, None] * e + np.sin(up)[:, None] * np.array((0.0, 0.0, 1.0))
    c = 0.05 * e + (0.0, 0.0, 0.1) + rounding * n
    force = rng.normal(size=(count, 3))
    force *= -np.sign(np.sum(force * n, axis=1))[:, None]
    cosine = -np.sum(force * n, axis=1) / np.linalg.norm(force, axis=1)
    force, n, c = force[cosine > 1e-2], n[cosine > 1e-2], c[cosine > 1e-2]
    for torsion in (0.0, 5e-5, 0.05):
        xi = torsion * rng.normal(size=(len(c), 1))
        found = solve_batch(drum, force, np.cross(c, force) + xi * n)
        assert np.mean(~found.ok) < 1e-3
        assert found.residual[found.ok].max() < 1e-13


SCALED: dict[str, tuple[Surface, object]] = {
    "sphere": (Sphere(0.05), lambda u: Sphere(0.05 * u)),
    "ellipsoid": (Ellipsoid(0.05, 0.1, 0.2), lambda u: Ellipsoid(0.05 * u, 0.1 * u, 0.2 * u)),
    "cylinder": (Cylinder(0.05), lambda u: Cylinder(0.05 * u)),
    "cone": (Cone(0.05, 0.2), lambda u: Cone(0.05 * u, 0.2)),
    "plane": (Plane((0.0, 0.0, 1.0), 0.1), lambda u: Plane((0.0, 0.0, 1.0), 0.1 * u)),
    "capsule": (Capsule(0.1, 0.05), lambda u: Capsule(0.1 * u, 0.05 * u)),
    "revolved": (Revolved(0.1, 0.05, 0.04, 0.01), lambda u: Revolved(0.1 * u, 0.05 * u, 0.04 * u, 0.01 * u)),
    "box": (Box(0.1, 0.05, 0.04, 0.01), lambda u: Box(0.1 * u, 0.05 * u, 0.04 * u, 0.01 * u)),
    "polytope": (Polytope(CUBE, 0.01), lambda u: Polytope(np.array(CUBE) * u, 0.01 * u)),
    "superquadric": (Superquadric(0.05, 0.07, 0.1), lambda u: Superquadric(0.05 * u, 0.07 * u, 0.1 * u)),
    "paraboloid": (Paraboloid(2.0, 1.0, 1.0), lambda u: Paraboloid(2.0 / u, 1.0 / u, u)),
}


@pytest.mark.parametrize("name", SCALED)
@pytest.mark.parametrize(
    ("force_unit", "length_unit"), [(-300, 0), (270, 0), (0, -665), (0, 665), (300, -532)]
)
def test_units_do_not_matter(name: str, force_unit: int, length_unit: int) -> None:
    """Powers of two: the same digits in every unit."""
    surface, scaled = SCALED[name]
    newton, metre = 2.0**force_unit, 2.0**length_unit
    rng = np.random.default_rng(5)
    force = rng.normal(size=(30, 3)) - (0.0, 0.0, 1.5)
    moment = np.cross(0.03 * rng.normal(size=(30, 3)) + (0.0, 0.0, 0.03), force)
    moment += 0.01 * rng.normal(size=(30, 1)) * force
    for method in ("exact", "wrench_axis"):
        ours = solve_batch(surface, force, moment, method)  # type: ignore[arg-type]
        theirs = solve_batch(scaled(metre), newton * force, newton * metre * moment, method)  # type: ignore[operator, arg-type]
        np.testing.assert_array_equal(theirs.status, ours.status)
        ok = ours.ok & (ours.condition < 1e4)
        assert ok.sum() > 5
        np.testing.assert_allclose(theirs.centroid[ok] / metre, ours.centroid[ok], rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(np.linalg.norm(theirs.normal[ok], axis=1), 1.0, rtol=1e-12)
        np.testing.assert_allclose(theirs.condition[ok], ours.condition[ok], rtol=1e-6)


def test_a_polytope_far_from_the_origin_is_as_accurate_as_its_moment() -> None:
    far = np.array((1e6, -5e5, 2.5e5))
    near, away = Polytope(CUBE, 0.01), Polytope(np.array(CUBE) + far, 0.01)
    n = np.ones(3) / np.sqrt(3.0)
    c = np.array((0.1, 0.04, 0.07)) + 0.01 * n
    force = np.array((-0.4, -0.5, -0.6))
    here = solve(near, force, np.cross(c, force) + 0.001 * n)
    there = solve(away, force, np.cross(c + far, force) + 0.001 * n)
    assert here.ok
    assert there.ok
    # One ulp of the moment, of the points and of the centroid.
    np.testing.assert_allclose(there.centroid - far, here.centroid, atol=1e-9)
