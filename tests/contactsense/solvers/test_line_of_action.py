"""The line of action enters a body on its surface, pushing; if it misses, the nearest point is returned."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contactsense.robots import Inertia, Link
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.primitives import Box, Capsule, Cylinder, Ellipsoid, Primitive, Sphere
from contactsense.robots.surface.convex_primitives import Surfaces, pack, project
from contactsense.solvers.posterior.line_of_action import ENTRY_TOLERANCE
from contactsense.solvers.wrench import Wrench, wrench_of
from tests.contactsense.solvers.one_lane import enter_surface

SHAPES: tuple[Primitive, ...] = (
    Sphere(center=(0, 0, 0), radius=0.05),
    Capsule(a=(0, 0, -0.2), b=(0, 0, 0.2), radius=0.04),
    Cylinder(a=(0, 0, -0.1), b=(0, 0, 0.1), radius_a=0.06, radius_b=0.04, rounding=0.005),
    Ellipsoid(center=(0, 0, 0), radii=(0.1, 0.05, 0.02)),
    Box(center=(0, 0, 0), half=(0.1, 0.05, 0.03), rounding=0.004),
)
UNIT = st.floats(-1.0, 1.0)
TRIPLE = st.tuples(UNIT, UNIT, UNIT)


def _packed(shape: Primitive) -> Surfaces:
    return pack([Link("one", Inertia(1.0, np.zeros(3), np.eye(3)), (shape,))])


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.kind)
@settings(max_examples=200)
@given(target=TRIPLE, direction=TRIPLE, size=st.sampled_from([1e-9, 1.0, 1e9]))
def test_a_line_through_the_body_is_followed_to_its_first_intersection(
    shape: Primitive, target: tuple[float, ...], direction: tuple[float, ...], size: float
) -> None:
    surfaces = _packed(shape)
    kind, dimensions, radius = surfaces.kind[0], surfaces.size[0], surfaces.radius[0]
    inside = 0.5 * np.array(target) * min(dimensions[dimensions > 0])
    f = np.array(direction)
    if np.linalg.norm(f) < 1e-3 or project(kind, dimensions, *inside)[0] > -1e-4:
        return
    f *= size
    distance, *hit = enter_surface(kind, dimensions, wrench_of(f, np.cross(inside, f)))
    point, normal = np.array(hit)
    assert distance == 0.0
    assert abs(project(kind, dimensions, *point)[0]) < 1e-8
    unit = f / np.linalg.norm(f)
    # The line counts as having entered within this tolerance of the surface.
    assert np.linalg.norm(np.cross(point - inside, unit)) <= ENTRY_TOLERANCE * radius + 1e-12
    assert normal @ unit < 0.0
    # The first intersection: the line is outside before it.
    for back in (1e-3, 1e-2, 0.1, 0.5):
        assert project(kind, dimensions, *(point - back * unit))[0] > 0.0


@kernel
def _least_distance(kind: int, size: np.ndarray, points: np.ndarray) -> float:
    """Distance from the surface to the nearest of the points, shape (N, 3)."""
    least = np.inf
    for i in range(points.shape[0]):
        least = min(least, project(kind, size, points[i, 0], points[i, 1], points[i, 2])[0])
    return least


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.kind)
@settings(max_examples=100)
@given(direction=TRIPLE, offset=st.floats(1.05, 30.0))
def test_a_line_that_misses_returns_a_point_that_can_be_pushed(
    shape: Primitive, direction: tuple[float, ...], offset: float
) -> None:
    surfaces = _packed(shape)
    kind, dimensions, radius = surfaces.kind[0], surfaces.size[0], surfaces.radius[0]
    f = np.array(direction)
    if np.linalg.norm(f) < 1e-3:
        return
    f /= np.linalg.norm(f)
    side = np.cross(f, [0.3, -0.5, 0.8])
    line_point = offset * radius * side / np.linalg.norm(side)
    distance, *hit = enter_surface(kind, dimensions, wrench_of(f, np.cross(line_point, f)))
    point, normal = np.array(hit)
    along = np.linspace(-2, 2, 4001)[:, None] * radius
    nearest = _least_distance(kind, dimensions, line_point + along * f)
    assert 0.0 < distance <= nearest + 1e-9
    assert abs(project(kind, dimensions, *point)[0]) < 1e-9
    assert normal @ f < 1e-9


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.kind)
def test_a_zero_force_returns_a_point_on_the_surface(shape: Primitive) -> None:
    surfaces = _packed(shape)
    wrench = Wrench((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    distance, point, _ = enter_surface(surfaces.kind[0], surfaces.size[0], wrench)
    assert distance == 0.0
    assert abs(project(surfaces.kind[0], surfaces.size[0], *point)[0]) < 1e-9
