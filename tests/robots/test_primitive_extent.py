"""Sizes of primitives along the axes of their frame."""

import numpy as np
import pytest

from contactsense.robots.primitive_extent import bounds
from contactsense.robots.primitives import Box, Capsule, Cylinder, Ellipsoid, Primitive, Sphere

PALM = Box(center=(0.0, 0.0, 0.05), half=(0.04, 0.03, 0.05), rounding=0.005)


@pytest.mark.parametrize(
    ("shape", "lower", "upper"),
    [
        (Sphere(center=(1.0, 2.0, 3.0), radius=0.5), (0.5, 1.5, 2.5), (1.5, 2.5, 3.5)),
        (Capsule(a=(0.0, 0.0, 0.0), b=(0.0, 0.0, 1.0), radius=0.1), (-0.1, -0.1, -0.1), (0.1, 0.1, 1.1)),
        (
            Cylinder(a=(0.0, 0.0, 0.0), b=(0.0, 0.0, 1.0), radius_a=0.2, radius_b=0.1, rounding=0.01),
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
