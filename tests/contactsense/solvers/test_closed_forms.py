"""Every closed form finds the contacts that were constructed."""

import numpy as np
import pytest

from contactsense.robots import primitives
from contactsense.robots.surface.convex_primitives import body, project
from contactsense.solvers import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    Paraboloid,
    Placed,
    Plane,
    Revolved,
    Sphere,
    Status,
    Surface,
    TaperedCapsule,
    place,
    solve,
    solve_batch,
    solve_primitive,
)
from contactsense.solvers.wrench import wrench_of
from tests.contactsense.solvers.contacts import draw

SURFACES = [
    Sphere(0.05),
    Ellipsoid(0.05, 0.1, 0.2),
    Ellipsoid(1.0, 1e-6, 1e-6),
    Ellipsoid(1.0, 1.0, 1e-6),
    Cylinder(0.06),
    Plane((1.0, -2.0, 3.0), 0.1),
    Plane((0.0, 0.0, -1.0), -0.1),
    Capsule(0.2, 0.06),
    TaperedCapsule(0.2, 0.08, 0.05),
    TaperedCapsule(0.1, 0.02, 0.2),
    Cone(0.1, 0.2),
    Cone(0.1, -3.0),
    Box(0.1, 0.04, 0.07, 0.01),
    Box(0.1, 0.0, 0.07, 1e-4),
    Revolved(0.1, 0.04, 0.02, 0.01),
    Revolved(0.0, 0.05, 0.05, 0.02),
    Revolved(0.1, 0.05, 0.0, 1e-4),
    Revolved(0.1, 0.0, 0.0, 0.05),
    Paraboloid(20.0, 10.0, 0.1),
    Paraboloid(1e4, 1e-3, 0.1),
]


@pytest.mark.slow
@pytest.mark.parametrize("surface", SURFACES, ids=str)
@pytest.mark.parametrize("torsion", [0.0, 1e-300, 1e-8, 0.5, 30.0])
def test_recovers_contacts(surface: Surface, torsion: float) -> None:
    contacts = draw(surface, np.random.default_rng(4), 4000, torsion)
    found = solve_batch(surface, contacts.force, contacts.moment)
    assert np.all(found.ok)
    error = np.linalg.norm(found.centroid - contacts.centroid, axis=1)
    error /= np.linalg.norm(contacts.centroid, axis=1)
    condition = contacts.relative_condition(found.condition)
    assert np.all(error <= 16 * np.finfo(float).eps * condition)
    assert np.all(np.sum(found.force * found.normal, axis=1) < 0.0)
    np.testing.assert_allclose(np.linalg.norm(found.normal, axis=1), 1.0, rtol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("surface", SURFACES, ids=str)
def test_contacts_that_do_not_graze_are_accurate_to_nine_digits(surface: Surface) -> None:
    contacts = draw(surface, np.random.default_rng(5), 4000, 0.1)
    found = solve_batch(surface, contacts.force, contacts.moment)
    error = np.linalg.norm(found.centroid - contacts.centroid, axis=1)
    error /= np.linalg.norm(contacts.centroid, axis=1)
    ordinary = contacts.relative_condition(found.condition) < 1e5
    assert ordinary.mean() > 0.1
    assert error[ordinary].max() < 1e-9


def test_single_and_batch_agree() -> None:
    surface = Capsule(0.2, 0.06)
    contacts = draw(surface, np.random.default_rng(6), 50)
    found = solve_batch(surface, contacts.force, contacts.moment)
    for i in range(50):
        one = solve(surface, contacts.force[i], contacts.moment[i])
        assert one.status == found.status[i]
        np.testing.assert_array_equal(one.centroid, found.centroid[i])
        np.testing.assert_array_equal(one.normal, found.normal[i])
        assert (one.torsion, one.residual, one.condition) == (
            found.torsion[i],
            found.residual[i],
            found.condition[i],
        )


def test_a_placed_surface_is_solved_in_its_pose() -> None:
    rng = np.random.default_rng(7)
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    axes *= np.linalg.det(axes)
    origin = np.array((0.3, -0.2, 0.5))
    surface = Placed(Ellipsoid(0.05, 0.1, 0.2), origin, axes)
    own = draw(surface.surface, rng, 200)
    centroid, force = origin + own.centroid @ axes.T, own.force @ axes.T
    moment = own.moment @ axes.T + np.cross(origin, force)
    found = solve_batch(surface, force, moment)
    np.testing.assert_allclose(found.centroid, centroid, atol=1e-11)
    np.testing.assert_allclose(found.normal, own.normal @ axes.T, atol=1e-10)
    one = solve(surface, force[0], moment[0])
    np.testing.assert_allclose(one.centroid, centroid[0], atol=1e-12)
    np.testing.assert_array_equal(one.force, force[0])


@pytest.mark.slow
@pytest.mark.parametrize("surface", [s for s in SURFACES if not isinstance(s, Ellipsoid)], ids=str)
def test_without_torsion_the_wrench_axis_agrees(surface: Surface) -> None:
    contacts = draw(surface, np.random.default_rng(8), 2000, 0.0)
    exact = solve_batch(surface, contacts.force, contacts.moment)
    axis = solve_batch(surface, contacts.force, contacts.moment, "wrench_axis")
    ordinary = exact.condition < 1e4
    assert np.all(axis.ok[ordinary])
    np.testing.assert_allclose(axis.centroid[ordinary], exact.centroid[ordinary], rtol=1e-9, atol=1e-10)


MISSED = {
    Sphere(0.05): (0.08, 0.05),
    Ellipsoid(0.05, 0.1, 0.2): (0.08, 0.05),
    Cylinder(0.05): (0.08, 0.05),
    Capsule(0.2, 0.05): (0.08, 0.05),
    TaperedCapsule(0.2, 0.05, 0.05): (0.08, 0.05),
}


@pytest.mark.parametrize("surface", MISSED, ids=str)
@pytest.mark.parametrize("method", ["exact", "wrench_axis"])
def test_a_pure_force_that_passes_by_misses(surface: Surface, method: str) -> None:
    # Along y, at x = 0.08: it passes the body at x = 0.05.
    at, nearest = MISSED[surface]
    force = np.array((0.0, 3.0, 0.0))
    found = solve(surface, force, np.cross((at, 0.0, 0.0), force), method)
    assert found.status == Status.MISS
    np.testing.assert_allclose(found.centroid, (nearest, 0.0, 0.0), atol=1e-9)
    np.testing.assert_allclose(found.normal, (1.0, 0.0, 0.0), atol=1e-9)
    assert found.residual > 0.1


def test_a_pure_force_above_a_paraboloid_misses() -> None:
    dish = Paraboloid(4.0, 16.0, 1.0)
    # Along (1, 0, 1): it is parallel to the surface at x = -0.25, and passes 0.25 above it there.
    force = np.array((3.0, 0.0, 3.0))
    for method in ("exact", "wrench_axis"):
        found = solve(dish, force, np.cross((-0.25, 0.125, 0.0), force), method)  # type: ignore[arg-type]
        assert found.status == Status.MISS
        np.testing.assert_allclose(found.centroid, (-0.25, 0.125, -0.25), atol=1e-15)
    touching = solve(dish, force, np.cross((-0.25, 0.0, -0.125), force))
    assert touching.status == Status.TANGENT
    np.testing.assert_allclose(touching.centroid, (-0.25, 0.0, -0.125), atol=1e-15)


def test_a_tangent_line_is_degenerate() -> None:
    for surface in (Sphere(0.5), Ellipsoid(0.5, 0.25, 2.0), Cylinder(0.5)):
        found = solve(surface, (0.0, 2.0, 0.0), (0.0, 0.0, 1.0))
        assert found.status == Status.TANGENT
        assert found.status.degenerate
        np.testing.assert_allclose(found.centroid, (0.5, 0.0, 0.0), atol=1e-15)
        assert found.condition == np.inf


def test_pulling_and_parallel() -> None:
    floor = Plane((0.0, 0.0, 1.0), 0.1)
    pulled = solve(floor, (0.0, 0.0, 1.0), (0.2, 0.0, 0.0))
    assert pulled.status == Status.PULLING
    np.testing.assert_allclose(pulled.centroid, (0.0, 0.2, 0.1), atol=1e-15)
    dish = solve(Paraboloid(2.0, 8.0, 1.0), (0.0, 0.0, 1.0), np.cross((0.5, 0.25, 0.0), (0.0, 0.0, 1.0)))
    assert dish.status == Status.PULLING
    np.testing.assert_allclose(dish.centroid, (0.5, 0.25, -0.5), atol=1e-15)
    assert solve(floor, (1.0, 0.0, 0.0), (0.2, 0.0, 0.0)).status == Status.PARALLEL
    assert solve(Cylinder(0.1), (0.0, 0.0, 1.0), (0.2, 0.0, 0.0)).status == Status.PARALLEL


@pytest.mark.parametrize("surface", SURFACES, ids=str)
@pytest.mark.parametrize("method", ["exact", "wrench_axis"])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_non_finite_wrenches_are_reported(surface: Surface, method: str, bad: float) -> None:
    for i in range(6):
        wrench = np.array((1.0, 2.0, -3.0, 0.1, 0.2, 0.3))
        wrench[i] = bad
        found = solve(surface, wrench[:3], wrench[3:], method)
        assert found.status == Status.NOT_FINITE
        assert np.all(np.isfinite(found.centroid))
    none = solve(surface, np.zeros(3), (0.1, 0.2, 0.3), method)
    assert none.status == Status.NO_FORCE


@pytest.mark.parametrize("surface", SURFACES[:6] + SURFACES[7:], ids=str)
def test_units_do_not_matter(surface: Surface) -> None:
    contacts = draw(surface, np.random.default_rng(9), 300, 0.3)
    expected = solve_batch(surface, contacts.force, contacts.moment)
    for power in (-1000, -600, -80, 80, 600, 1000):
        scale = 2.0**power
        found = solve_batch(surface, contacts.force * scale, contacts.moment * scale)
        assert np.all(found.ok)
        np.testing.assert_allclose(found.centroid, expected.centroid, rtol=1e-13, atol=1e-300)
        np.testing.assert_allclose(found.torsion / scale, expected.torsion, rtol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("surface", SURFACES, ids=str)
def test_kernels_are_total(surface: Surface) -> None:
    rng = np.random.default_rng(10)
    values = (0.0, -0.0, 5e-324, 1e-300, 1e-150, 1.0, -1.0, 1e150, 1e308, 0.1)
    wrenches = rng.choice(values, size=(5000, 6)) * rng.choice((-1.0, 1.0), size=(5000, 6))
    for method in ("exact", "wrench_axis"):
        found = solve_batch(surface, wrenches[:, :3], wrenches[:, 3:], method)
        for values_of in (found.centroid, found.normal, found.torsion, found.residual, found.condition):
            assert not np.any(np.isnan(values_of))


def test_a_sharp_box_is_solved_on_its_faces_and_sharp_at_its_edges() -> None:
    block = Box(0.1, 0.2, 0.3, 0.0)
    force = np.array((1.0, -2.0, -3.0))
    on_face = solve(block, force, np.cross((0.05, 0.1, 0.3), force) + np.array((0.0, 0.0, 0.01)))
    assert on_face.ok
    np.testing.assert_allclose(on_face.centroid, (0.05, 0.1, 0.3), atol=1e-15)
    assert on_face.torsion == pytest.approx(0.01)
    # Torsion about a corner pushes the contact out of each of its three faces.
    force = np.array((-1.0, -2.0, -3.0))
    moment = np.cross((0.1, 0.2, 0.3), force) + np.full(3, 0.001)
    on_corner = solve(block, force, moment)
    assert on_corner.status == Status.SHARP
    assert not on_corner.status.degenerate
    np.testing.assert_allclose(on_corner.centroid, (0.1, 0.2, 0.3), atol=1e-3)


@pytest.mark.parametrize("kind", ["sphere", "capsule", "cylinder", "ellipsoid", "box"])
def test_packed_primitives_are_solved_in_their_pose(kind: str) -> None:
    shapes = {
        "sphere": primitives.Sphere(center=(0.1, 0.2, 0.3), radius=0.05),
        "capsule": primitives.Capsule(a=(0.0, 0.1, 0.0), b=(0.2, 0.1, 0.3), radius=0.05),
        "cylinder": primitives.Cylinder(
            a=(0.0, 0.1, 0.0), b=(0.2, 0.1, 0.3), radius_a=0.06, radius_b=0.05, rounding=0.01
        ),
        "ellipsoid": primitives.Ellipsoid(
            center=(0.1, 0.0, 0.0), rpy=(0.1, 0.2, 0.3), radii=(0.1, 0.05, 0.2)
        ),
        "box": primitives.Box(
            center=(0.1, 0.0, 0.0), rpy=(0.1, 0.2, 0.3), half=(0.1, 0.05, 0.2), rounding=0.01
        ),
    }
    number, rotation, origin, dimensions = body(shapes[kind])
    size = np.zeros(8)
    size[: len(dimensions)] = dimensions
    rng = np.random.default_rng(11)
    for _ in range(100):
        row = np.array(project(number, size, *rng.normal(size=3)))
        c, n = row[1:4], row[4:]
        f = rng.normal(size=3)
        f *= -np.sign(f @ n)
        answer = solve_primitive(number, size, wrench_of(f, np.cross(c, f) + 0.01 * rng.normal() * n))
        assert answer.status == Status.OK
        np.testing.assert_allclose(answer.centroid, c, atol=1e-9)
        placed = solve(place(shapes[kind]), rotation @ f, np.cross(origin + rotation @ c, rotation @ f))
        np.testing.assert_allclose(placed.centroid, origin + rotation @ c, atol=1e-8)


def test_invalid_sizes_are_rejected() -> None:
    with pytest.raises(ValueError, match="radius must be positive"):
        Sphere(0.0)
    with pytest.raises(ValueError, match="one ball holds the other"):
        TaperedCapsule(0.1, 0.5, 0.1)
    with pytest.raises(ValueError, match="wrench_axis"):
        solve(Sphere(1.0), np.ones(3), np.ones(3), "magic")
