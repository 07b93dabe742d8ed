"""Depth and deepest point of primitives in obstacles: against samples of their surfaces and the condition
that two convex bodies' deepest point meets."""

import numpy as np
import pytest

from contactsense.robots.primitives import Box, Capsule, Cylinder, Ellipsoid, Sphere
from contactsense.robots.rotations import rotation_from_rpy
from contactsense.robots.surface.convex_primitives import body, project, support
from contactsense.service.mock.arm.obstacles import BoxObstacle, HalfSpace, SphereObstacle
from contactsense.service.mock.physics.bodies import obstacle_arrays
from contactsense.service.mock.physics.contact_kernels import deepest_point

PRIMITIVES = [
    Sphere(center=(0.0, 0.0, 0.0), radius=0.05),
    Capsule(a=(0.0, 0.0, -0.1), b=(0.0, 0.0, 0.1), radius=0.04),
    Cylinder(a=(0.0, 0.0, -0.06), b=(0.0, 0.0, 0.06), radius_a=0.05, radius_b=0.03, rounding=0.01),
    Ellipsoid(center=(0.0, 0.0, 0.0), radii=(0.03, 0.05, 0.08)),
    Box(center=(0.0, 0.0, 0.0), half=(0.03, 0.05, 0.08), rounding=0.01),
]


def distance_to(obstacle, points):
    """Signed distance of points (N, 3) to an obstacle, by its definition."""
    if isinstance(obstacle, HalfSpace):
        normal = np.array(obstacle.normal) / np.linalg.norm(obstacle.normal)
        return (points - obstacle.point) @ normal
    if isinstance(obstacle, SphereObstacle):
        return np.linalg.norm(points - obstacle.center, axis=1) - obstacle.radius
    local = np.abs((points - obstacle.center) @ rotation_from_rpy(obstacle.rpy))
    beyond = local - (np.array(obstacle.half) - obstacle.rounding)
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    return outside + np.minimum(beyond.max(axis=1), 0.0) - obstacle.rounding


def surface_points(shape, rotation, origin, chance):
    """Surface points of a primitive, dense."""
    kind, own, centre, size = body(shape)
    padded = np.zeros(8)
    padded[: len(size)] = size
    ways = chance.standard_normal((4_000, 3))
    points = np.array([support(kind, padded, *way) for way in ways])
    # Support points cover edges and curved parts; a convex body's flat parts lie between them.
    mixed = points[chance.permutation(len(points))]
    share = chance.random((len(points), 1))
    points = np.vstack([points, share * points + (1 - share) * mixed])
    return (points @ own.T + centre) @ rotation.T + origin


@pytest.mark.parametrize("shape", PRIMITIVES, ids=lambda shape: shape.kind)
@pytest.mark.parametrize("what", ["half_space", "sphere", "box"])
def test_depth_and_point(shape, what):
    chance = np.random.default_rng(7)
    kind, own, centre, size = body(shape)
    padded = np.zeros(8)
    padded[: len(size)] = size
    for _ in range(4):
        rotation = rotation_from_rpy(chance.uniform(-3, 3, 3))
        normal = chance.standard_normal(3)
        normal /= np.linalg.norm(normal)
        match what:
            case "half_space":
                obstacle = HalfSpace(point=(0.1, 0.2, 0.3), normal=tuple(normal))
            case "sphere":
                obstacle = SphereObstacle(center=(0.1, 0.2, 0.3), radius=0.06)
            case _:
                obstacle = BoxObstacle(
                    center=(0.1, 0.2, 0.3), rpy=(0.3, 0.5, 1.0), half=(0.1, 0.12, 0.15), rounding=0.02
                )
        # Nearer along a ray, until it is about 5 mm deep.
        points = surface_points(shape, rotation, np.zeros(3), chance)
        way = normal if what == "half_space" else chance.standard_normal(3)
        way = way / np.linalg.norm(way)
        low, high = 0.0, 0.6
        for _ in range(40):
            middle = 0.5 * (low + high)
            origin = np.array([0.1, 0.2, 0.3]) + middle * way
            low, high = (
                (middle, high) if distance_to(obstacle, points + origin).min() < -0.005 else (low, middle)
            )
        pose = rotation @ own, origin + rotation @ centre
        depth, *found = deepest_point(kind, padded, *pose, obstacle_arrays([obstacle]), 0)
        point, outward = np.array(found[:3]), np.array(found[3:])
        assert depth >= -distance_to(obstacle, points + origin).min() - 1e-9
        assert -distance_to(obstacle, point[None])[0] == pytest.approx(depth, abs=1e-8)
        assert np.linalg.norm(outward) == pytest.approx(1.0)
        # It is on the primitive, whose normal is opposite there: of convex bodies there is no deeper point.
        gap, *rest = project(kind, padded, *(pose[0].T @ (point - pose[1])))
        assert gap == pytest.approx(0.0, abs=1e-9)
        np.testing.assert_allclose(pose[0] @ np.array(rest[3:]), -outward, atol=1e-4)
        # The normal is the way on which the obstacle is left soonest.
        step = 1e-6
        gradient = [
            (
                distance_to(obstacle, (point + step * e)[None])
                - distance_to(obstacle, (point - step * e)[None])
            )[0]
            / (2 * step)
            for e in np.eye(3)
        ]
        np.testing.assert_allclose(outward, gradient, atol=1e-4)


def test_a_face_that_is_entered_deeply():
    shape = Sphere(center=(0.0, 0.0, 0.0), radius=0.05)
    kind, _, _, size = body(shape)
    padded = np.zeros(8)
    padded[: len(size)] = size
    box = BoxObstacle(center=(0.0, 0.0, 0.0), half=(0.2, 0.2, 0.2), rounding=0.01)
    origin = np.array([0.01, 0.02, 0.21])
    depth, *found = deepest_point(kind, padded, np.eye(3), origin, obstacle_arrays([box]), 0)
    assert depth == pytest.approx(0.04)
    np.testing.assert_allclose(found, [0.01, 0.02, 0.16, 0.0, 0.0, 1.0], atol=1e-12)
