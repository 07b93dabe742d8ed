"""Rotations in the notation of robot files."""

from collections.abc import Sequence
from math import cos, sin

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
