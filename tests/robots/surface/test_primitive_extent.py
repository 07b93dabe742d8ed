"""Sizes of primitives along the axes of their frame."""

import numpy as np
import pytest

from contactsense.robots.primitives import Box, Capsule, Cylinder, Ellipsoid, Primitive, Sphere
from contactsense.robots.surface.primitive_extent import bounds

PALM = Box(center=(0.0, 0.0, 0.05), half=(0.04, 0.03, 0.05), rounding=0.005)


@pytest.mark.parametrize(
    ("shape", "lower", "upper"),
    [
        (Sphere(center=(1.0, 2.0, 3.0), radius=0.5), (0.5, 1.5, 2.5), (1.5, 2.5, 3.5)),
        (Capsule(a=(0.0, 0.0, 0.0), b=(0.0, 0.0, 1.0), radius=0.1), (-0.1, -0.1, -0.1), (0.1, 0.1, 1.1)),
        (
            Cylinder(a=(0.0, 0.0, 0.0), b=(0.0, 0.0, 1.0), radius_a=0.2, radius_b=0.2, rounding=0.01),
            (-0.2, -0.2, 0.0),
            (0.2, 0.2, 1.0),
        ),
        (
            Ellipsoid(center=(0.0, 0.0, 0.0), rpy=(0.0, 0.0, np.pi / 2), radii=(1.0, 2.0, 3.0)),
            (-2.0, -1.0, -3.0),
            (2.0, 1.0, 3.0),
        ),
        (PALM, (-0.04, -0.03, 0.0), (0.04, 0.03, 0.1)),
    ],
)
def test_bounds_hold_each_kind(shape: Primitive, lower: tuple[float], upper: tuple[float]) -> None:
    np.testing.assert_allclose(bounds(shape), (lower, upper), atol=1e-12)


@pytest.mark.parametrize("slope", [0.1, 2.0, 200.0])
def test_bounds_of_a_cone_are_those_of_its_rounded_body(slope: float) -> None:
    """The sharp rim of a flat cone, which is cut off, may be metres away."""
    ball, half, radius = 0.004, 0.001, 0.03
    off = ball * (np.hypot(1.0, slope) - slope)
    cone = Cylinder(
        a=(0.0, 0.0, -half - ball),
        b=(0.0, 0.0, half + ball),
        radius_a=radius + slope * 2.0 * half + 2.0 * slope * ball + off,
        radius_b=radius + off,
        rounding=ball,
    )
    # The axis of the cone is that of the rim about which the ball rolls.
    assert cone.core() == pytest.approx((half, radius + slope * 2.0 * half, radius), rel=1e-9)
    widest = radius + slope * 2.0 * half + ball
    reach = (widest, widest, half + ball)
    np.testing.assert_allclose(bounds(cone), (np.negative(reach), reach), rtol=1e-9)
