"""Regions that lie on the surface and hold nine of ten contacts; arrows that end at the contact."""

import numpy as np
import pytest

from contactsense import Scene
from contactsense.robots.primitives import Box, Cylinder, Sphere
from contactsense.robots.surface.union import distances
from contactsense.robots.surroundings import Body
from contactsense.robots.tool import Tool
from contactsense.service.drawing.contact_shapes import arrow_ends, region_patch
from contactsense.service.drawing.link_geometry import geometry_of
from contactsense.service.drawing.mesh import Mesh

PLATE = Box(center=(0.0, 0.0, 0.1), half=(0.2, 0.2, 0.1), rounding=0.005)
TUBE = Cylinder(a=(0, 0, -0.3), b=(0, 0, 0.3), radius_a=0.05, radius_b=0.05, rounding=0.004)
BALL = Sphere(center=(0.0, 0.0, 0.0), radius=0.08)
UP = np.array([0.0, 0.0, 1.0])


def with_tool(shape: Box | Cylinder | Sphere) -> Scene:
    return Scene(robot="ur5e", tool=Tool(name="hand", primitives=(shape,)))


def area(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0)


def holds(mesh: Mesh, places: np.ndarray) -> np.ndarray:
    """Whether places of a plane lie in a mesh in that plane, both in two coordinates."""
    found = np.zeros(len(places), dtype=bool)
    for triangle in mesh.vertices[mesh.faces][:, :, :2]:
        edges = np.roll(triangle, -1, axis=0) - triangle
        to = places[:, None] - triangle
        found |= (edges[:, 0] * to[:, :, 1] - edges[:, 1] * to[:, :, 0] >= 0.0).all(axis=1)
    return found


@pytest.mark.parametrize("deviations", [(0.002, 0.002), (0.02, 0.005), (0.001, 0.03)])
def test_a_region_of_a_flat_surface_holds_nine_of_ten_places(deviations: tuple[float, float]) -> None:
    rng = np.random.default_rng(1)
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    covariance = np.diag([0.0, 0.0, 1e-4])
    covariance[:2, :2] = turn @ np.diag(np.square(deviations)) @ turn.T
    point = np.array([0.01, 0.02, 0.2])
    patch = region_patch(with_tool(PLATE), 7, point, UP, covariance)
    places = point[:2] + rng.multivariate_normal(np.zeros(2), covariance[:2, :2], 4000)
    # One standard deviation of the count is 0.5 %.
    assert holds(patch, places).mean() == pytest.approx(0.9, abs=0.015)


def test_regions_lie_on_the_surface_of_the_arm() -> None:
    scene = Scene(robot="ur5e")
    geometry = geometry_of(scene)
    rng = np.random.default_rng(0)
    for link, deviation in ((1, 0.02), (2, 0.005), (2, 0.1), (3, 0.03), (4, 0.02), (6, 0.5)):
        triangles = geometry.triangles[link]
        point = triangles[rng.integers(len(triangles))].mean(axis=0)
        _, _, normal = distances(geometry.surfaces, point[None], link)
        A = deviation * rng.standard_normal((3, 3))
        patch = region_patch(scene, link, point, normal[0], A @ A.T)
        corners = patch.vertices[patch.faces]
        inside = np.einsum("ti,tij->tj", rng.dirichlet(np.ones(3), len(corners)), corners)
        everywhere = np.concatenate((patch.vertices, inside))
        assert np.abs(distances(geometry.surfaces, everywhere, link)[0]).max() < 0.00105


def test_a_region_is_bent_around_the_surface_without_being_stretched() -> None:
    ball = region_patch(with_tool(BALL), 7, np.array([0.0, 0.0, 0.08]), UP, 0.02**2 * np.eye(3))
    radius = np.sqrt(4.605) * 0.02
    cap = 2.0 * np.pi * 0.08**2 * (1.0 - np.cos(radius / 0.08))
    assert area(ball) == pytest.approx(cap, rel=0.03)
    tube = region_patch(
        with_tool(TUBE), 7, np.array([0.05, 0.0, 0.0]), np.array([1.0, 0, 0]), 0.01**2 * np.eye(3)
    )
    edge = np.arctan2(tube.vertices[:, 1], tube.vertices[:, 0]) * 0.05
    assert edge.max() == pytest.approx(np.sqrt(4.605) * 0.01, rel=0.02)
    assert tube.vertices[:, 2].max() == pytest.approx(np.sqrt(4.605) * 0.01, rel=0.02)


def test_a_huge_region_is_the_whole_link_and_no_more() -> None:
    side = np.array([1.0, 0.0, 0.0])
    surface = 2.0 * np.pi * 0.05 * 0.6 + 2.0 * np.pi * 0.05**2
    for variance in (10.0, 1e300):
        patch = region_patch(with_tool(TUBE), 7, 0.05 * side, side, variance * np.eye(3))
        assert area(patch) == pytest.approx(surface, rel=0.05)


def test_a_region_does_not_reach_through_a_thin_link() -> None:
    sheet = Box(center=(0.0, 0.0, 0.0), half=(0.2, 0.2, 0.003), rounding=0.001)
    patch = region_patch(with_tool(sheet), 7, np.array([0.0, 0.0, 0.003]), UP, 0.02**2 * np.eye(3))
    assert patch.vertices[:, 2].min() > 0.0


@pytest.mark.parametrize("variances", [(0.0, 0.0, 0.0), (1e-4, 0.0, 0.0), (1e-18, 1e-4, -1e-12)])
def test_degenerate_covariances_can_still_be_seen(variances: tuple[float, float, float]) -> None:
    patch = region_patch(with_tool(PLATE), 7, np.array([0.0, 0.0, 0.2]), UP, np.diag(variances))
    size = np.ptp(patch.vertices, axis=0)[:2]
    expected = 2.0 * np.maximum(np.sqrt(4.605 * np.maximum(variances[:2], 0.0)), 0.001)
    np.testing.assert_allclose(size, expected, rtol=0.03)


def test_what_is_not_known_has_no_region() -> None:
    scene, point, nowhere = with_tool(PLATE), np.array([0.0, 0.0, 0.2]), np.full(3, np.nan)
    for arguments in (
        (nowhere, UP, np.eye(3)),
        (point, nowhere, np.eye(3)),
        (point, UP, np.full((3, 3), np.nan)),
        (point, UP, np.diag([np.inf, 1.0, 1.0])),
    ):
        assert len(region_patch(scene, 7, *arguments).faces) == 0


def test_an_arrow_ends_at_the_contact_and_shows_the_force() -> None:
    point, force = np.array([0.1, 0.2, 0.3]), np.array([0.0, 12.0, 16.0])
    tail, head = arrow_ends(point, force)
    np.testing.assert_array_equal(head, point)
    np.testing.assert_allclose(head - tail, 0.008 * force)
    lengths = [np.linalg.norm(np.subtract(*arrow_ends(point, size * force))) for size in (1e-3, 0.5, 2, 1e6)]
    assert lengths[0] == pytest.approx(0.08)
    assert lengths == sorted(lengths)
    assert lengths[-1] == pytest.approx(0.45)
    for nothing in (np.zeros(3), np.full(3, np.nan), np.array([np.inf, 0.0, 0.0])):
        tail, head = arrow_ends(point, nothing)
        np.testing.assert_array_equal(tail, head)


def test_a_region_on_a_pedestal_lies_on_it() -> None:
    """Contacts on pedestals are contacts of the base link."""
    column = Cylinder(a=(0, 0, -0.8), b=(0, 0, 0), radius_a=0.1, radius_b=0.1, rounding=0.01)
    pedestal = Body(name="column", role="pedestal", translation=(0.3, 0.0, 0.0), primitives=(column,))
    side = np.array([1.0, 0.0, 0.0])
    point = np.array([0.4, 0.0, -0.4])
    patch = region_patch(Scene(robot="ur5e", bodies=(pedestal,)), 0, point, side, 0.01**2 * np.eye(3))
    away = np.linalg.norm(patch.vertices - point, axis=1)
    assert 0.02 < away.max() < 0.023
    from_axis = np.hypot(patch.vertices[:, 0] - 0.3, patch.vertices[:, 1])
    np.testing.assert_allclose(from_axis, 0.1, atol=0.001)
    table = Scene(robot="ur5e", bodies=(pedestal.model_copy(update={"role": "obstacle"}),))
    assert len(region_patch(table, 0, point, side, 0.01**2 * np.eye(3)).faces) == 0
