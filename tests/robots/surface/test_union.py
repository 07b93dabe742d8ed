"""Distance to a union of primitives."""

import numpy as np

from contactsense.robots.primitives import Capsule, Primitive, Sphere
from contactsense.robots.robot import Inertia, Link
from contactsense.robots.surface.convex_primitives import pack, project
from contactsense.robots.surface.union import distances

BODY = Inertia(1.0, np.zeros(3), np.eye(3))
SHAPES: tuple[Primitive, ...] = (
    Sphere(center=(0.0, 0.0, 0.0), radius=0.1),
    Capsule(a=(0.0, 0.0, 0.0), b=(0.3, 0.0, 0.1), radius=0.05),
    Sphere(center=(0.5, 0.0, 0.0), radius=0.02),
)


def test_the_nearest_of_all_counts() -> None:
    surfaces = pack([Link("other", BODY, SHAPES[:1]), Link("link", BODY, SHAPES)])
    points = np.random.default_rng(0).uniform(-0.6, 0.6, size=(500, 3))
    distance, which, normal = distances(surfaces, points, 1)
    for i, point in enumerate(points):
        each = []
        for p in range(1, 4):
            local = surfaces.rotation[p].T @ (point - surfaces.origin[p])
            each.append(project(int(surfaces.kind[p]), surfaces.size[p], *local))
        best = int(np.argmin([answer[0] for answer in each]))
        assert which[i] == best + 1
        np.testing.assert_allclose(distance[i], each[best][0], atol=1e-15)
        np.testing.assert_allclose(normal[i], surfaces.rotation[best + 1] @ each[best][4:], atol=1e-12)


def test_without_primitives_everything_is_infinitely_far() -> None:
    distance, which, _ = distances(pack([Link("link", BODY)]), np.zeros((2, 3)))
    assert distance.tolist() == [np.inf, np.inf]
    assert which.tolist() == [-1, -1]
