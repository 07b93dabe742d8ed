"""Friction of the drives in the joint torques of a scene that states none."""

import numpy as np

from contactsense.scene import Scene
from contactsense.sensors.settings import per_joint
from contactsense.setup_check.fit.fitter import Fitter
from contactsense.setup_check.setup import Setup

_NOISE_FACTOR = 2.0
"""Friction below this multiple of the standard deviation that the scene states, noise and model error, hardly
appears as a contact."""
_MIN_SIGNIFICANCE = 5.0
"""Friction is told if it differs from zero by this many standard deviations of the estimate."""


def unstated_friction(scene: Scene, fitter: Fitter, setup: Setup) -> tuple[float, ...] | None:
    """Coulomb friction of each joint, shape (n,) [Nm], where it is worth telling: see `SetupCheck.friction`.

    Args:
        scene: What is checked.
        fitter: Of the recordings.
        setup: The one that explains the readings.
    """
    sensor, estimate = scene.joint_torque, fitter.friction(setup)
    if sensor is None or estimate is None:
        return None
    stated, n = sensor.friction, len(scene.robot.joints)
    if np.any([per_joint(x, n) for x in (stated.coulomb, stated.load, stated.viscous, stated.lubricant)]):
        return None
    found, std = estimate
    allowed = np.hypot(per_joint(sensor.noise, n), per_joint(sensor.model_error, n))
    if (found > np.maximum(_NOISE_FACTOR * allowed, _MIN_SIGNIFICANCE * std)).any():
        return tuple(np.maximum(found, 0.0).tolist())
    return None
