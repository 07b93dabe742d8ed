"""Rotations in the notation of robot files, and matrices of vectors and tensors."""

from collections.abc import Sequence
from math import atan2, cos, hypot, sin

import numpy as np


def rotation_from_rpy(rpy: Sequence[float]) -> np.ndarray:
    """Rotation matrix (3, 3) of roll, pitch, yaw about the fixed axes x, y, z [rad], as in a URDF."""
    cr, cp, cy = (cos(angle) for angle in rpy)
    sr, sp, sy = (sin(angle) for angle in rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


_LOCKED = 1e-9
"""Roll and yaw turn about the same axis where the cosine of the pitch is smaller."""


def rpy_from_rotation(rotation: np.ndarray) -> tuple[float, float, float]:
    """Roll, pitch, yaw [rad] of a rotation matrix (3, 3); yaw is zero where it cannot be told from roll."""
    R, cosine = rotation, hypot(rotation[0, 0], rotation[1, 0])
    pitch = atan2(-R[2, 0], cosine)
    if cosine < _LOCKED:
        return atan2(-R[1, 2], R[1, 1]), pitch, 0.0
    return atan2(R[2, 1], R[2, 2]), pitch, atan2(R[1, 0], R[0, 0])


def rotation_from_vector(turn: np.ndarray | Sequence[float]) -> np.ndarray:
    """Rotation matrix (3, 3) of a rotation vector [rad]: its direction is the axis, its length the angle."""
    angle = float(np.linalg.norm(turn))
    if angle == 0.0:
        return np.eye(3)
    axis = cross_matrix(np.asarray(turn) / angle)
    return np.asarray(np.eye(3) + np.sin(angle) * axis + (1.0 - np.cos(angle)) * axis @ axis)


def frame_along(axis: np.ndarray) -> np.ndarray:
    """A rotation (3, 3) whose third column is the unit vector along `axis`."""
    z = axis / np.linalg.norm(axis)
    x = np.zeros(3)
    x[int(np.argmin(np.abs(z)))] = 1.0
    x -= (x @ z) * z
    x /= np.linalg.norm(x)
    return np.column_stack((x, np.cross(z, x), z))


def cross_matrix(v: np.ndarray | Sequence[float]) -> np.ndarray:
    """The matrix (3, 3) whose product with any vector is the cross product of v (3,) with it."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def symmetric(tensor: Sequence[float]) -> np.ndarray:
    """Matrix (3, 3) of its components xx, xy, xz, yy, yz, zz."""
    xx, xy, xz, yy, yz, zz = tensor
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
