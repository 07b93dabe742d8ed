"""How large the torques of each joint are, also of an arm whose data state no limits."""

import numpy as np

from contactsense.robots.robot import Robot

_GRAVITY = 9.81
_RESERVE = 2.0
"""Largest torque over that which holds the stretched arm without a payload: 2.1 to 3.2 at the shoulders of
the library's arms."""
_LEAST_SHARE = 0.2
"""Smallest ratio of a joint's largest torque to that of the strongest joint: 0.14 to 0.21 at the wrists of
the library's arms."""
_LEAST = 1.0
"""The same of an arm without masses [Nm]."""


def torque_scales(robot: Robot) -> np.ndarray:
    """Largest torque of each joint, or about that where its limit is not known, shape (n,) [Nm].

    For priors, thresholds and stiffnesses that grow with the drive. What a joint can do at most is its limit.
    """
    limits = np.array([joint.torque_limit for joint in robot.joints])
    return np.where(np.isfinite(limits), limits, _estimated(robot))


def _estimated(robot: Robot) -> np.ndarray:
    """From the torques that hold the arm if it were stretched out from each joint."""
    holding = np.zeros(len(robot.joints))
    for j in range(len(holding)):
        reach = 0.0
        for link, beyond in zip(robot.links[j + 1 :], [*robot.joints[j + 1 :], None], strict=True):
            lever = reach + float(np.linalg.norm(link.inertia.com))
            holding[j] += _GRAVITY * link.inertia.mass * lever
            if beyond is not None:
                reach += float(np.linalg.norm(beyond.translation))
    return np.maximum(_RESERVE * holding, max(_LEAST_SHARE * _RESERVE * float(holding.max()), _LEAST))
