"""Bodies of revolution without branches, against the kernels with branches."""

import numpy as np
import pytest

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.primitives import Capsule, Cylinder, Primitive, Sphere
from contactsense.robots.surface.convex_primitives import REVOLVED, body, curvature, project
from contactsense.robots.surface.simd_revolved import curvature_revolved, profile, project_revolved

SHAPES: tuple[Primitive, ...] = (
    Sphere(center=(0, 0, 0), radius=0.05),
    Capsule(a=(0, 0, -0.2), b=(0, 0, 0.2), radius=0.05),
    Cylinder(a=(0, 0, -0.1), b=(0, 0, 0.1), radius_a=0.06, radius_b=0.05, rounding=0.01),
    Cylinder(a=(0, 0, -0.1), b=(0, 0, 0.1), radius_a=0.01, radius_b=0.08, rounding=0.004),
    Cylinder(a=(0, 0, -0.02), b=(0, 0, 0.02), radius_a=0.1, radius_b=0.1, rounding=0.02),
)
HARD = (
    (0.0, 0.0, 0.0),
    (0.0, 0.0, 0.3),
    (0.0, 0.0, -0.3),
    (0.05, 0.0, 0.0),
    (0.0, -0.05, 0.09),
    (1e-12, 0.0, 0.09),
    (1e-12, 1e-12, 0.0),
    (0.3, 0.4, 0.09),
    (1e3, -1e3, 1e3),
)


@kernel
def _project(size: np.ndarray, points: np.ndarray, out: np.ndarray) -> None:
    shape = profile(size[0], size[1], size[2], size[3])
    for i in range(points.shape[0]):
        d, x, y, z, nx, ny, nz = project_revolved(shape, points[i, 0], points[i, 1], points[i, 2])
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = d, x, y, z
        out[i, 4], out[i, 5], out[i, 6] = nx, ny, nz


@kernel
def _curvature(size: np.ndarray, places: np.ndarray, out: np.ndarray) -> None:
    shape = profile(size[0], size[1], size[2], size[3])
    for i in range(places.shape[0]):
        p = places[i]
        xx, xy, xz, yy, yz, zz = curvature_revolved(shape, p[1], p[2], p[4], p[5], p[6])
        out[i, 0], out[i, 1], out[i, 2], out[i, 3], out[i, 4], out[i, 5] = xx, xy, xz, yy, yz, zz


def _size(shape: Primitive) -> np.ndarray:
    kind, _, _, size = body(shape)
    assert kind == REVOLVED
    return np.array((*size, 0.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.kind)
def test_nearest_points_and_curvatures_are_the_same(shape: Primitive) -> None:
    size = _size(shape)
    random = np.random.default_rng(1).uniform(-0.3, 0.3, (2000, 3))
    points = np.concatenate((random, HARD))
    found, bend = np.empty((len(points), 7)), np.empty((len(points), 6))
    _project(size, points, found)
    expected = np.array([project(REVOLVED, size, *point) for point in points])
    scale = 1.0 + np.abs(points).max(axis=1, keepdims=True)
    np.testing.assert_allclose(found / scale, expected / scale, atol=1e-13)
    # Of the same places, as a seam may be on either side of a rounding error.
    _curvature(size, expected, bend)
    np.testing.assert_allclose(
        bend, [curvature(REVOLVED, size, *place[1:]) for place in expected], rtol=1e-9, atol=1e-9
    )
