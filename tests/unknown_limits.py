"""An arm as from a URDF that states no largest torques and speeds."""

from dataclasses import replace

import numpy as np

from contactsense import robots


def without_limits(arm: robots.Robot) -> robots.Robot:
    """The arm, its largest torques and speeds unknown."""
    joints = (replace(joint, torque_limit=np.inf, velocity_limit=np.inf) for joint in arm.joints)
    return replace(arm, joints=tuple(joints))
