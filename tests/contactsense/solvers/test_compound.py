"""Bodies put together from parts: one answer everywhere, and honest ones at edges."""

from collections.abc import Callable

import numpy as np
import pytest

from contactsense.benchmarks.solvers.sampling import unit
from contactsense.solvers import (
    Box,
    Capsule,
    Compound,
    Cone,
    Cylinder,
    Ellipsoid,
    Fingertip,
    Part,
    Placed,
    Plane,
    Sphere,
    Status,
    Surface,
    sensitivity,
    solve,
    solve_batch,
)
from tests.contactsense.solvers.contacts import draw

UP, DOWN = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
TIP = Compound(
    [
        Part(Sphere(0.03), (Plane(DOWN, 0.0),)),
        Part(Cylinder(0.03), (Plane(UP, 0.0),)),
    ],
    0.1,
)
DRUM = Compound.common([Cylinder(0.05), Plane(UP, 0.08), Plane(DOWN, 0.08)], 0.1)
"""A cylinder with flat ends and sharp rims."""
LENS = Compound.common(
    [
        Placed(Sphere(0.1), np.array((0.0, 0.0, -0.06)), np.eye(3)),
        Placed(Ellipsoid(0.08, 0.1, 0.12), np.array((0.0, 0.01, 0.06)), np.eye(3)),
    ],
    0.1,
)
POST = Compound.common(
    [Cone(0.06, 0.3), Plane((0.1, 0.0, 1.0), 0.07), Plane((0.0, 0.2, -1.0), 0.05), Cylinder(0.055)], 0.1
)
"""A cone within a cylinder, cut at two slants."""
BODIES = {"tip": TIP, "drum": DRUM, "lens": LENS, "post": POST}


def _points(body: Compound, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Surface points and normals from lines through the middle, each by a search of its own."""
    ends = 0.3 * unit(rng.normal(size=(count, 3)))
    force = -ends
    found = solve_batch(body, force, np.zeros((count, 3)), "wrench_axis")
    assert np.all(found.ok)
    return found.centroid, found.normal


def _alone(body: Compound, part: Part) -> Compound:
    return Compound([part], body.reach)


@pytest.mark.slow
@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("torsion", [0.0, 1e-8, 0.3])
def test_recovers_contacts_on_exactly_one_part(name: str, torsion: float) -> None:
    body = BODIES[name]
    rng = np.random.default_rng(1)
    centroid, normal = _points(body, rng, 2000)
    force = unit(rng.normal(size=centroid.shape))
    force *= -np.sign(np.sum(force * normal, axis=1, keepdims=True))
    xi = 0.1 * torsion * rng.normal(size=(len(centroid), 1))
    moment = np.cross(centroid, force) + xi * normal
    found = solve_batch(body, force, moment)
    assert np.all(found.ok)
    error = np.linalg.norm(found.centroid - centroid, axis=1)
    lever = np.linalg.norm(centroid, axis=1)
    condition = lever + found.condition * (lever + np.linalg.norm(moment, axis=1))
    assert np.all(error <= 16 * np.finfo(float).eps * condition)
    answers = np.zeros(len(centroid), dtype=int)
    for part in body.parts:
        answers += solve_batch(_alone(body, part), force, moment).ok
    assert np.all(answers == 1)


@pytest.mark.slow
def test_a_compound_fingertip_is_the_fingertip() -> None:
    own = Fingertip(0.03)
    contacts = draw(own, np.random.default_rng(2), 2000, 0.3)
    expected = solve_batch(own, contacts.force, contacts.moment)
    found = solve_batch(TIP, contacts.force, contacts.moment)
    np.testing.assert_array_equal(found.status, expected.status)
    assert np.all(np.abs(found.centroid - expected.centroid).max(axis=1) <= 1e-15 * (1.0 + found.condition))
    for force, moment in zip(contacts.force[:50], contacts.moment[:50], strict=True):
        one, other = solve(TIP, force, moment), solve(own, force, moment)
        if one.condition < 10.0:
            np.testing.assert_allclose(
                sensitivity(TIP, one).by_force, sensitivity(own, other).by_force, rtol=1e-9, atol=1e-12
            )


@pytest.mark.slow
def test_six_planes_are_a_sharp_box() -> None:
    half = (0.1, 0.04, 0.07)
    planes = [
        Plane((sign * (i == 0), sign * (i == 1), sign * (i == 2)), half[i])
        for i in range(3)
        for sign in (1, -1)
    ]
    body, box = Compound.common(planes, 0.1), Box(*half, 0.0)
    rng = np.random.default_rng(3)
    force = unit(rng.normal(size=(2000, 3)))
    # Lines through the box and near it, half of them with a torsion.
    through = rng.uniform(-1.2, 1.2, size=(2000, 3)) * half
    moment = np.cross(through, force) + 0.01 * force * (rng.uniform(size=(2000, 1)) < 0.5)
    found, expected = solve_batch(body, force, moment), solve_batch(box, force, moment)
    np.testing.assert_array_equal(found.status, expected.status)
    assert {Status.OK, Status.SHARP, Status.MISS} <= set(found.status.tolist())
    touched = found.status != Status.MISS
    np.testing.assert_allclose(found.centroid[touched], expected.centroid[touched], atol=1e-9)


def test_a_pure_force_on_an_edge_is_found_and_a_torsion_is_sharp() -> None:
    rim = np.array((0.03, 0.04, 0.08))
    force = np.array((-1.0, -0.5, -2.0))
    for method in ("exact", "wrench_axis"):
        touch = solve(DRUM, force, np.cross(rim, force), method)  # type: ignore[arg-type]
        assert touch.status == Status.OK
        np.testing.assert_allclose(touch.centroid, rim, atol=1e-12)
    # A soft touch there: an answer on a smooth part nearby, or the rim.
    twist = 0.002 * unit(np.random.default_rng(4).normal(size=(500, 3)))
    found = solve_batch(DRUM, np.tile(force, (500, 1)), np.cross(rim, force) + twist)
    assert set(found.status.tolist()) == {Status.OK, Status.SHARP}
    assert not Status.SHARP.degenerate
    np.testing.assert_allclose(found.centroid, np.tile(rim, (500, 1)), atol=5e-3)


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("method", ["exact", "wrench_axis"])
def test_statuses(name: str, method: str) -> None:
    body = BODIES[name]
    assert solve(body, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), method).ok  # type: ignore[arg-type]
    assert solve(body, (0.0, 0.0, -1.0), (3.0, 0.0, 0.0), method).status == Status.MISS  # type: ignore[arg-type]
    assert solve(body, (0.0,) * 3, (1.0,) * 3, method).status == Status.NO_FORCE  # type: ignore[arg-type]
    bad = solve(body, (0.0, np.nan, 1.0), (1.0,) * 3, method)  # type: ignore[arg-type]
    assert bad.status == Status.NOT_FINITE
    rng = np.random.default_rng(10)
    values = (0.0, -0.0, 5e-324, 1e-300, 1e-150, 1.0, -1.0, 1e150, 1e308, 0.1)
    wrenches = rng.choice(values, size=(2000, 6)) * rng.choice((-1.0, 1.0), size=(2000, 6))
    found = solve_batch(body, wrenches[:, :3], wrenches[:, 3:], method)  # type: ignore[arg-type]
    for values_of in (found.centroid, found.normal, found.torsion, found.residual, found.condition):
        assert not np.any(np.isnan(values_of))


def test_a_placed_compound_is_solved_in_its_pose() -> None:
    rng = np.random.default_rng(5)
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    axes *= np.linalg.det(axes)
    origin = np.array((0.3, -0.2, 0.5))
    turned = Compound.common(
        [
            Placed(Cylinder(0.05), origin, axes),
            Placed(Plane(UP, 0.08), origin, axes),
            Placed(Plane(DOWN, 0.08), origin, axes),
        ],
        0.1,
    )
    force, moment = rng.normal(size=(200, 3)), 0.02 * rng.normal(size=(200, 3))
    here = solve_batch(Placed(DRUM, origin, axes), force, moment + np.cross(origin, force))
    there = solve_batch(turned, force, moment + np.cross(origin, force))
    np.testing.assert_array_equal(here.status, there.status)
    ordinary = here.ok & (here.condition < 1e3)
    assert ordinary.sum() > 20
    np.testing.assert_allclose(there.centroid[ordinary], here.centroid[ordinary], atol=1e-11)


@pytest.mark.parametrize(
    "place", [lambda body: body, lambda body: Placed(body, np.ones(3), np.eye(3)[[1, 2, 0]])]
)
def test_the_curvature_at_a_rim_is_that_of_the_touched_face(place: Callable[[Compound], Surface]) -> None:
    """There several parts are equally near."""
    for rim in (0.05, 0.05 - 1e-12, 0.05 + 1e-12):
        for normal, bend in ((UP, 0.0), ((0.6, 0.8, 0.0), 20.0)):
            body, point = place(DRUM), np.array((0.6 * rim, 0.8 * rim, 0.08))
            turn = body.rotation if isinstance(body, Placed) else np.eye(3)
            origin = body.origin if isinstance(body, Placed) else np.zeros(3)
            found = body.shape_operator(origin + turn @ point, turn @ np.array(normal))
            np.testing.assert_allclose(np.linalg.norm(found), bend, rtol=1e-6)


def test_derivatives_at_a_rim_are_those_of_the_touched_face() -> None:
    point, force = np.array((0.05, 0.0, 0.08)), np.array((0.0, 0.1, -3.0))
    found = solve(DRUM, force, np.cross(point, force))
    assert found.ok
    np.testing.assert_allclose(np.linalg.norm(sensitivity(DRUM, found).by_moment, 2), 1.0 / 3.0)


def test_a_part_that_is_placed_twice_is_solved_in_both_poses() -> None:
    quarter = np.array(((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
    inner = Placed(Ellipsoid(0.02, 0.03, 0.04), np.array((0.0, 0.1, 0.0)), quarter)
    twice = Placed(inner, np.array((0.0, 0.0, 0.5)), quarter.T)
    force, moment = np.array((0.2, 0.1, -3.0)), np.array((0.01, -0.32, 0.0))
    alone, part = (solve(body, force, moment) for body in (twice, Compound([Part(twice, ())], 1.0)))
    assert alone.ok
    np.testing.assert_allclose(part.centroid, alone.centroid, atol=1e-12)


def test_invalid_parts_are_rejected() -> None:
    with pytest.raises(ValueError, match="parts must not be empty"):
        Compound([], 1.0)
    with pytest.raises(ValueError, match="reach must be positive"):
        Compound.common([Sphere(1.0)], 0.0)
    with pytest.raises(ValueError, match="Capsule has no closed form of one surface"):
        Compound.common([Placed(Capsule(1.0, 1.0), np.zeros(3), np.eye(3))], 1.0)
