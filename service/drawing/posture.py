"""The posture in which an arm is drawn while none is known."""

import numpy as np


def usual_posture(joints: int) -> np.ndarray:
    """An arm that is bent, with its tool over the table, shape (joints,) [rad]."""
    q = np.zeros(joints)
    q[1 : min(4, joints)] = np.radians([-70.0, 80.0, -60.0])[: joints - 1]
    return q
