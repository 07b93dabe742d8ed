"""Fitted bodies as primitives of a file."""

import numpy as np
import pytest

from contactsense.robots.decomposition.yaml_export import primitive
from contactsense.robots.primitives import Box, Ellipsoid
from contactsense.robots.rotations import rotation_from_rpy
from contactsense.robots.surface.convex_primitives import BOX, ELLIPSOID

UPRIGHT = (0.4, np.pi / 2.0, 0.0), (-1.1, -np.pi / 2.0, 0.7)
"""Orientations with the x axis up or down, where roll and yaw turn about the same axis."""


@pytest.mark.parametrize("kind", [BOX, ELLIPSOID])
@pytest.mark.parametrize("rpy", [(0.3, -0.2, 1.4), *UPRIGHT])
def test_a_body_keeps_its_orientation(kind: int, rpy: tuple[float, float, float]) -> None:
    rotation = rotation_from_rpy(rpy)
    rotation[np.abs(rotation) < 1e-15] = 0.0
    made = primitive(kind, rotation, np.zeros(3), np.array([0.1, 0.2, 0.3, 0.01]))
    assert isinstance(made, Box | Ellipsoid)
    np.testing.assert_allclose(rotation_from_rpy(made.rpy), rotation, atol=2e-4)
