"""Noiseless readings of an arm at rest that nobody touches."""

import numpy as np

from contactsense import Scene
from contactsense.kinematics.inverse_dynamics import inverse_dynamics
from contactsense.kinematics.model import build_model, empty_motion


def weight(scene: Scene, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Joint torques and base wrench."""
    joints = len(scene.robot.joints)
    torque, wrench, zero = np.empty(joints), np.empty(6), np.zeros(joints)
    motion = empty_motion(joints)
    inverse_dynamics(build_model(scene.robot), q, zero, zero, scene.gravity_base, motion, torque, wrench)
    return torque, wrench
