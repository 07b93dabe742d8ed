"""Meshes that lie on the surface, and meshes of the real arm where there are any."""

import numpy as np
import pytest

from contactsense import Scene
from contactsense.robots.primitives import Box, Capsule, Cylinder, Ellipsoid, Primitive, Sphere
from contactsense.robots.robot import Inertia, Link
from contactsense.robots.surface.convex_primitives import pack
from contactsense.robots.surface.union import distances
from contactsense.robots.tool import Tool
from contactsense.service.drawing.link_geometry import Mesh, geometry_of, link_meshes
from contactsense.service.drawing.primitive_meshes import surface_mesh

WEIGHTLESS = Inertia(0.0, np.zeros(3), np.zeros((3, 3)))
BALL = Sphere(center=(0.1, 0.0, 0.0), radius=0.06)
CAPSULE = Capsule(a=(0, 0, 0), b=(0.2, 0.1, 0), radius=0.05)
ELLIPSOID = Ellipsoid(center=(0, 0, 0.1), rpy=(1, 0, 0), radii=(0.03, 0.06, 0.09))
VOLUMES: list[tuple[Primitive, float]] = [
    (BALL, 4.0 / 3.0 * np.pi * 0.06**3),
    (CAPSULE, np.pi * 0.05**2 * (np.hypot(0.2, 0.1) + 0.2 / 3.0)),
    (ELLIPSOID, 4.0 / 3.0 * np.pi * 0.03 * 0.06 * 0.09),
]


def volume(mesh: Mesh) -> float:
    """Enclosed volume by the divergence theorem; positive if faces are counterclockwise from outside."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


@pytest.mark.parametrize(("shape", "expected"), VOLUMES)
def test_a_primitive_has_its_volume(shape: Primitive, expected: float) -> None:
    mesh = surface_mesh(pack([Link("one", WEIGHTLESS, (shape,))]), 0)
    # Chords 0.3 mm inside the surface cost up to one part in a hundred of bodies of this size.
    assert 0.97 * expected < volume(mesh) < expected


def test_a_box_and_a_cylinder_with_small_rims_have_nearly_the_volume_of_sharp_ones() -> None:
    box = Box(center=(0, 0, 0), rpy=(0.3, 0.2, 0.1), half=(0.05, 0.1, 0.15), rounding=0.001)
    mesh = surface_mesh(pack([Link("one", WEIGHTLESS, (box,))]), 0)
    assert volume(mesh) == pytest.approx(8 * 0.05 * 0.1 * 0.15, rel=0.01)
    cone = Cylinder(a=(0, 0, 0), b=(0, 0, 0.3), radius_a=0.1, radius_b=0.05, rounding=0.001)
    mesh = surface_mesh(pack([Link("one", WEIGHTLESS, (cone,))]), 0)
    expected = np.pi * 0.3 / 3.0 * (0.1**2 + 0.1 * 0.05 + 0.05**2)
    assert volume(mesh) == pytest.approx(expected, rel=0.015)


def test_the_meshes_of_an_arm_lie_on_its_surface_and_cover_it() -> None:
    scene = Scene(robot="ur5e")
    geometry = geometry_of(scene)
    assert len(geometry.meshes) == len(scene.link_names) == 7
    rng = np.random.default_rng(0)
    for link, mesh in enumerate(geometry.meshes):
        corners = geometry.triangles[link]
        weights = rng.dirichlet(np.ones(3), len(corners))
        inside = np.einsum("ti,tij->tj", weights, corners)
        assert np.abs(distances(geometry.surfaces, inside, link)[0]).max() < 0.001
        # Rays from far outside end on the surface; a mesh that covers it is near to each end.
        middle, size = mesh.vertices.mean(axis=0), np.ptp(mesh.vertices, axis=0).max()
        directions = rng.standard_normal((200, 3))
        outside = middle + size * directions / np.linalg.norm(directions, axis=1, keepdims=True)
        distance, _, normal = distances(geometry.surfaces, outside, link)
        nearest = outside - distance[:, None] * normal
        reach = np.linalg.norm(nearest[:, None] - corners.mean(axis=1), axis=2)
        longest = np.linalg.norm(corners - corners.mean(axis=1, keepdims=True), axis=2).max(axis=1)
        assert ((reach - longest) < 0.003).any(axis=1).all()


def test_a_tool_is_drawn_in_the_frame_of_the_flange() -> None:
    tool = Tool(name="hand", primitives=(Sphere(center=(0.0, 0.0, 0.1), radius=0.04),))
    meshes = link_meshes(Scene(robot="ur5e", tool=tool))
    assert len(meshes) == 8
    np.testing.assert_allclose(np.linalg.norm(meshes[7].vertices - (0.0, 0.0, 0.1), axis=1), 0.04)
    # A tool without a surface is no link.
    assert len(link_meshes(Scene(robot="ur5e", tool=Tool(mass=1.0)))) == 7


def test_an_arm_without_known_meshes_shows_its_primitives() -> None:
    pytest.importorskip("airo_models")
    scene = Scene(robot="ur20")
    for drawn, primitives in zip(link_meshes(scene, visual=True), link_meshes(scene), strict=True):
        assert drawn is primitives


@pytest.mark.slow
def test_the_meshes_of_the_real_arm_have_few_triangles_and_lie_near_its_primitives() -> None:
    pytest.importorskip("airo_models")
    scene = Scene(robot="ur5e")
    meshes = link_meshes(scene, visual=True)
    assert 20_000 < sum(len(mesh.faces) for mesh in meshes) < 60_000
    for link, mesh in enumerate(meshes):
        off = np.abs(distances(geometry_of(scene).surfaces, mesh.vertices, link)[0])
        # Screws and inner faces are further away.
        assert np.median(off) < 0.01
