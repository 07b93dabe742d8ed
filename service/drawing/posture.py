"""The posture in which an arm is drawn while none is known."""

import numpy as np

from contactsense.robots import Robot

_BENT = np.radians([0.0, -70.0, 80.0, -60.0])
"""Of the first joints: an arm of Universal Robots has its tool over the table."""


def usual_posture(robot: Robot) -> np.ndarray:
    """An arm that is bent, within the limits of its joints, shape (n,) [rad]."""
    q = np.zeros(len(robot.joints))
    q[: len(_BENT)] = _BENT[: len(q)]
    low, high = np.array([joint.position_limits for joint in robot.joints]).T
    return np.asarray(np.clip(q, low, high))
