"""Where the arm is touched: free postures, exposed points, walks over a mesh."""

import numpy as np
import pytest
import trimesh

from contactsense.benchmarks.truth import simulation, touches
from contactsense.benchmarks.truth.arm import AXIS, Arm, Link, read
from contactsense.benchmarks.truth.exposure import AROUND, NEAR, OPEN, Exposure
from contactsense.benchmarks.truth.postures import Postures, slices
from contactsense.benchmarks.truth.schedule import SLIDE, Planned
from contactsense.benchmarks.truth.slide import Walker
from contactsense.benchmarks.truth.surface import Place, Surface, tangents
from tests.shared import truth

UPRIGHT = np.array([0.0, -np.pi / 2, 0.0, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def arm() -> Arm:
    return read("ur5e")


def link_of(mesh: trimesh.Trimesh) -> Link:
    return Link("", np.zeros(3), np.eye(3), AXIS, mesh.vertices, mesh.faces, 1.0, np.zeros(3), np.eye(3))


def test_postures_that_meet_themselves_or_the_plane_are_rejected(arm: Arm) -> None:
    postures = Postures(arm)
    assert postures.free(UPRIGHT)
    folded, lying, below = UPRIGHT.copy(), UPRIGHT.copy(), UPRIGHT.copy()
    folded[2] = np.radians(175.0)  # the wrist against the shoulder
    lying[1] = 0.0
    below[1] = np.radians(40.0)
    assert not postures.free(folded)
    assert postures.free(lying)
    assert not postures.free(below)


def test_drawn_postures_are_free_and_within_limits(arm: Arm) -> None:
    rng = np.random.default_rng(0)
    postures = Postures(arm)
    drawn = np.array([postures.draw(rng) for _ in range(50)])
    assert all(postures.free(q) for q in drawn)
    assert (drawn >= arm.limits[0]).all()
    assert (drawn <= arm.limits[1]).all()


def test_convex_pieces_contain_the_mesh(arm: Arm) -> None:
    for link in arm.links:
        pieces = [trimesh.convex.convex_hull(points) for points in slices(link)]
        rng = np.random.default_rng(1)
        surface = Surface([link])
        points = np.array([surface.draw(rng).point for _ in range(100)])
        # Signed distance to a convex hull by its planes.
        depth = [
            ((points[:, None] - hull.triangles_center) * hull.face_normals).sum(axis=2).max(axis=1)
            for hull in pieces
        ]
        assert np.min(depth, axis=0).max() < 1e-6


def test_points_are_uniform_by_area() -> None:
    """On a box the shares of its sides are those of their areas."""
    surface = Surface([link_of(trimesh.creation.box((1.0, 2.0, 3.0)))])
    rng = np.random.default_rng(2)
    places = [surface.draw(rng) for _ in range(4000)]
    share = np.mean([np.abs(place.normal) > 0.5 for place in places], axis=0)
    np.testing.assert_allclose(share, np.array([6.0, 3.0, 2.0]) / 11.0, atol=0.03)
    top = np.array([place.point[:2] for place in places if place.normal[2] > 0.5])
    np.testing.assert_allclose(np.abs(top).mean(axis=0), [0.25, 0.5], atol=0.05)


def test_rays_are_those_of_a_plain_calculation(arm: Arm) -> None:
    """Lengths of rays against all facets of all links, each intersected by a 3 x 3 system."""
    exposure, surface, rng = Exposure(arm), Surface(arm.links), np.random.default_rng(3)
    q = Postures(arm).draw(rng)
    exposure.place(q)
    origin, rotation = (pose[0] for pose in simulation.poses(simulation.dynamics(arm), q[None]))
    corners = np.concatenate([o + c @ R.T for o, R, c in zip(origin, rotation, surface.corners, strict=True)])
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across = np.cross(ab, ac)
    for _ in range(6):
        place = surface.draw(rng)
        start = origin[place.link] + rotation[place.link] @ (place.point + 1e-3 * place.normal)
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        with np.errstate(divide="ignore", invalid="ignore"):
            length = ((a - start) * across).sum(axis=1) / (across @ direction)
            inside = start + length[:, None] * direction - a
            square = (across**2).sum(axis=1)
            u = (np.cross(inside, ac) * across).sum(axis=1) / square
            v = (np.cross(ab, inside) * across).sum(axis=1) / square
        hit = (length > 0.0) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
        expected = length[hit].min() if hit.any() else np.inf
        found = exposure._lengths(start, direction[None])[0]
        assert found == pytest.approx(expected, abs=1e-6)


def test_insides_undersides_and_gaps_are_not_exposed(arm: Arm) -> None:
    exposure, surface, rng = Exposure(arm), Surface(arm.links), np.random.default_rng(4)
    exposure.place(UPRIGHT)
    outside = inside = 0
    for _ in range(150):
        place = surface.draw(rng)
        outside += exposure.exposed(place.link, place.point, place.normal)
        # The other side of a skin is within the link.
        inside += exposure.exposed(place.link, place.point, -place.normal)
    assert outside > 75
    assert inside == 0
    # Below the base is the mounting plane.
    assert not exposure.exposed(0, np.zeros(3), np.array([0.0, 0.0, -1.0]))
    assert not exposure.exposed(0, np.array([0.1, 0.0, 0.01]), np.array([0.0, 0.0, -1.0]))


def test_what_is_given_as_exposed_is_exposed(arm: Arm) -> None:
    data = truth("static_points_ur5e.npz")
    exposure = Exposure(arm)
    found = []
    for i in range(0, len(data["q"]), 10):
        exposure.place(data["q"][i])
        found.append(
            exposure.exposed(int(data["link"][i]), data["c_link"][i], data["n_link"][i].astype(float))
        )
    assert np.mean(found) > 0.99
    assert (NEAR, AROUND, OPEN) == (0.02, 0.04, 0.4)


def test_given_postures_are_free(arm: Arm) -> None:
    postures = Postures(arm)
    assert np.mean([postures.free(q) for q in truth("static_points_ur5e.npz")["q"][::4]]) > 0.995


def test_tangents_are_a_right_handed_frame() -> None:
    for normal in np.random.default_rng(5).normal(size=(20, 3)):
        unit = normal / np.linalg.norm(normal)
        frame = np.column_stack((*tangents(unit), unit))
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(frame) == pytest.approx(1.0)


def test_a_slide_that_has_no_time_for_five_millimetres_is_made(
    arm: Arm, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(touches, "_SPEEDS", (0.01, 0.01))
    planned = Planned(start=0, stop=150, type=SLIDE, slot=0)
    toucher = touches.Toucher(Surface(arm.links), Exposure(arm))
    made = toucher.draw(planned, np.tile(UPRIGHT, (150, 1)), False, None, np.random.default_rng(7))
    assert made.path == pytest.approx(0.01 * 149 / 500.0)
    way = np.linalg.norm(np.diff(made.points, axis=0), axis=1).sum()
    assert way == pytest.approx(made.path, rel=0.02)


def test_a_walk_around_a_sphere_is_a_great_circle() -> None:
    mesh = trimesh.creation.icosphere(4, 0.1)
    surface = Surface([link_of(mesh)])
    start = surface.draw(np.random.default_rng(6))
    direction = tangents(start.normal)[0]
    lengths = np.linspace(0.0, 0.3, 400)
    walk = Walker(surface).walk(start, direction, lengths)
    assert walk.length == pytest.approx(0.3)
    radius = np.linalg.norm(walk.points, axis=1)
    assert radius.max() <= 0.1
    assert radius.min() > 0.0995
    across = np.cross(start.point, direction)
    assert np.abs(walk.points @ across).max() / np.linalg.norm(across) < 3e-3
    # As far along the circle as along the mesh.
    angle = np.arccos(walk.points[-1] @ start.point / radius[-1] / np.linalg.norm(start.point))
    assert angle == pytest.approx(3.0, abs=0.02)
    steps = np.linalg.norm(np.diff(walk.points, axis=0), axis=1)
    np.testing.assert_allclose(steps, lengths[1], rtol=0.01)
    assert np.abs((walk.directions * walk.normals).sum(axis=1)).max() < 1e-12


def test_a_walk_ends_at_a_sharp_edge_and_at_the_end_of_the_mesh() -> None:
    box = Surface([link_of(trimesh.creation.box((1.0, 1.0, 1.0)).subdivide())])
    top = int(np.argmax(box.corners[0][:, :, 2].min(axis=1)))
    place = Place(0, top, box.corners[0][top].mean(axis=0), box.normals[0][top])
    direction = np.array([1.0, 0.0, 0.0])
    walk = Walker(box).walk(place, direction, np.linspace(0.0, 3.0, 50))
    assert walk.length == pytest.approx(0.5 - place.point[0])
    np.testing.assert_allclose(walk.points[-1], [0.5, place.point[1], 0.5], atol=1e-12)

    flat = trimesh.creation.box((1.0, 1.0, 1.0))
    flat.update_faces(flat.face_normals[:, 2] > 0.5)
    sheet = Surface([link_of(flat)])
    place = Place(0, 0, sheet.corners[0][0].mean(axis=0), sheet.normals[0][0])
    walk = Walker(sheet).walk(place, direction, np.linspace(0.0, 3.0, 50))
    assert walk.length == pytest.approx(0.5 - place.point[0])
    np.testing.assert_allclose(walk.points[:, 1:], np.tile(place.point[1:], (50, 1)), atol=1e-12)
