"""Rotation matrices against scipy's."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from contactsense.robots.rotations import rotation_from_vector


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, np.pi, 4.0])
def test_a_rotation_vector_is_axis_times_angle(angle: float) -> None:
    turn = angle * np.array([2.0, -1.0, 2.0]) / 3.0
    np.testing.assert_allclose(rotation_from_vector(turn), Rotation.from_rotvec(turn).as_matrix(), atol=1e-14)
