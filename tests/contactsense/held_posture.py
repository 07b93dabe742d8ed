"""Samples of a held posture in which the forearm is pushed."""

import numpy as np

from contactsense import Sample
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from tests.at_rest import weight
from tests.contactsense.precise import PRECISE

Q = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5])


def push_on_forearm() -> tuple[np.ndarray, np.ndarray]:
    """A push on the forearm's tube: contact point and wrench, base frame."""
    motion = empty_motion(6)
    forward_kinematics(build_model(PRECISE.robot), Q, motion)
    R, o = motion.rotation[3], motion.origin[3]
    point = R @ np.array([-0.2, 0.04, 0.007]) + o
    force = R @ np.array([1.0, -20.0, 0.0])
    return point, np.concatenate((force, np.cross(point, force)))


def pushed(count: int, wrench: np.ndarray, link: int, first: int = 100) -> list[Sample]:
    """Samples at 500 Hz; from the `first` on, that wrench acts on that link."""
    torque, reading = weight(PRECISE, Q)
    motion = empty_motion(6)
    forward_kinematics(build_model(PRECISE.robot), Q, motion)
    added = np.where(np.arange(6) < link, -motion.screw @ wrench, 0.0)
    zero = np.zeros(6)
    return [
        Sample(
            0.002 * i,
            Q,
            zero,
            torque + (added if i >= first else 0.0),
            reading + (wrench if i >= first else 0.0),
        )
        for i in range(count)
    ]
