"""Where the wrench axis enters a body: on the surface, on the axis, pushing; or near the axis where it
misses."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contactsense.seed import NEAR, enter
from robots import Inertia, Link
from robots.primitives import Box, Capsule, Cylinder, Ellipsoid, Primitive, Sphere
from robots.surface import Surfaces, pack, project

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


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.kind)
@settings(max_examples=200, derandomize=True, deadline=None)
@given(target=TRIPLE, direction=TRIPLE, size=st.sampled_from([1e-9, 1.0, 1e9]))
def test_an_axis_through_the_body_is_followed_to_where_it_enters(
    shape: Primitive, target: tuple[float, ...], direction: tuple[float, ...], size: float
) -> None:
    surfaces = _packed(shape)
    kind, dimensions, radius = surfaces.kind[0], surfaces.size[0], surfaces.radius[0]
    inside = 0.5 * np.array(target) * min(dimensions[dimensions > 0])
    f = np.array(direction)
    if np.linalg.norm(f) < 1e-3 or project(kind, dimensions, *inside)[0] > -1e-4:
        return
    f *= size
    gap, *rest = enter(kind, dimensions, radius, *f, *np.cross(inside, f))
    point, normal = np.array(rest[:3]), np.array(rest[3:])
    assert gap == 0.0
    assert abs(project(kind, dimensions, *point)[0]) < 1e-8
    unit = f / np.linalg.norm(f)
    # The axis counts as having entered this near to the surface; the point on it is no further off the axis.
    assert np.linalg.norm(np.cross(point - inside, unit)) <= NEAR * radius + 1e-12
    assert normal @ unit < 0.0
    # The first crossing: everything before it along the axis is outside.
    for back in (1e-3, 1e-2, 0.1, 0.5):
        assert project(kind, dimensions, *(point - back * unit))[0] > 0.0


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.kind)
@settings(max_examples=100, derandomize=True, deadline=None)
@given(direction=TRIPLE, away=st.floats(1.05, 30.0))
def test_an_axis_that_misses_gives_a_place_that_can_be_pushed(
    shape: Primitive, direction: tuple[float, ...], away: float
) -> None:
    surfaces = _packed(shape)
    kind, dimensions, radius = surfaces.kind[0], surfaces.size[0], surfaces.radius[0]
    f = np.array(direction)
    if np.linalg.norm(f) < 1e-3:
        return
    f /= np.linalg.norm(f)
    side = np.cross(f, [0.3, -0.5, 0.8])
    beside = away * radius * side / np.linalg.norm(side)
    gap, *rest = enter(kind, dimensions, radius, *f, *np.cross(beside, f))
    point, normal = np.array(rest[:3]), np.array(rest[3:])
    nearest = min(project(kind, dimensions, *(beside + s * f))[0] for s in np.linspace(-2, 2, 4001) * radius)
    assert 0.0 < gap <= nearest + 1e-9
    assert abs(project(kind, dimensions, *point)[0]) < 1e-9
    assert normal @ f < 1e-9


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.kind)
def test_no_force_gives_a_place_on_the_surface_and_no_hit(shape: Primitive) -> None:
    surfaces = _packed(shape)
    gap, *rest = enter(surfaces.kind[0], surfaces.size[0], surfaces.radius[0], 0.0, 0.0, 0.0, 1.0, 0.0, 0.0)
    assert gap == 0.0
    assert abs(project(surfaces.kind[0], surfaces.size[0], *rest[:3])[0]) < 1e-9
