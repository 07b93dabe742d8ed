"""Rotation matrices against scipy's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from contactsense.robots.rotations import rotation_from_rpy, rotation_from_vector, rpy_from_rotation


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, np.pi, 4.0])
def test_a_rotation_vector_is_axis_times_angle(angle: float) -> None:
    turn = angle * np.array([2.0, -1.0, 2.0]) / 3.0
    np.testing.assert_allclose(rotation_from_vector(turn), Rotation.from_rotvec(turn).as_matrix(), atol=1e-14)


ANGLE = st.floats(-3.0, 3.0) | st.sampled_from([0.0, np.pi / 2.0, -np.pi / 2.0, np.pi])


@given(roll=ANGLE, pitch=ANGLE, yaw=ANGLE)
def test_roll_pitch_and_yaw_give_the_rotation_again(roll: float, pitch: float, yaw: float) -> None:
    """Also with the x axis upright, where roll and yaw turn about the same axis."""
    rotation = rotation_from_rpy((roll, pitch, yaw))
    found = rpy_from_rotation(rotation)
    np.testing.assert_allclose(rotation_from_rpy(found), rotation, atol=1e-8)
    assert abs(found[1]) <= np.pi / 2.0 + 1e-12


def test_roll_pitch_and_yaw_are_those_of_scipy() -> None:
    rotation = Rotation.from_euler("xyz", [0.3, -1.2, 2.9])
    np.testing.assert_allclose(rpy_from_rotation(rotation.as_matrix()), rotation.as_euler("xyz"), atol=1e-14)
