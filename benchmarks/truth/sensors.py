"""What the sensors measure, by MuJoCo's inverse dynamics: joint torques and the wrench below the base.

tau is what the transmission applies, tau = M qdd + C + g - J^T w, with w the contacts' wrenches on the robot.
The base wrench is exerted by the arm on the sensor below it, about the base origin: at rest the force is the
arm's weight.
"""

from typing import NamedTuple

import mujoco
import numpy as np


class Contacts(NamedTuple):
    """Up to K contacts at a time on N samples, in base axes."""

    link: np.ndarray
    """Touched links, -1 for no contact, shape (N, K)."""
    point: np.ndarray
    """Shape (N, K, 3) [m]."""
    force: np.ndarray
    """On the robot, shape (N, K, 3) [N]."""
    moment: np.ndarray
    """About the point, on the robot, shape (N, K, 3) [Nm]."""


class Readings(NamedTuple):
    """Readings of N samples without noise."""

    torque: np.ndarray
    """Of the joints, shape (N, n) [Nm]."""
    base_wrench: np.ndarray
    """Force and moment, shape (N, 6) [N, Nm]."""


def read(
    model: mujoco.MjModel, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, contacts: Contacts
) -> Readings:
    """Readings of an arm that moves and is touched.

    Args:
        model: Of `simulation.dynamics`.
        q, qd, qdd: Positions, speeds, accelerations of the joints, shape (N, n) each [rad, rad/s, rad/s^2].
        contacts: What touches it.
    """
    data = mujoco.MjData(model)
    torque, base_wrench = np.empty((len(q), model.nv)), np.empty((len(q), 6))
    for i in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[i], qd[i], qdd[i]
        mujoco.mj_fwdPosition(model, data)
        data.xfrc_applied[:] = 0.0
        held = np.zeros(model.nv)
        for k in np.flatnonzero(contacts.link[i] >= 0):
            body = int(contacts.link[i, k]) + 1  # body 0 is the world
            point, force, moment = contacts.point[i, k], contacts.force[i, k], contacts.moment[i, k]
            data.xfrc_applied[body, :3] += force
            # MuJoCo applies these wrenches at the body's centre of mass.
            data.xfrc_applied[body, 3:] += moment + np.cross(point - data.xipos[body], force)
            mujoco.mj_applyFT(model, data, force, moment, point, body, held)
        mujoco.mj_inverse(model, data)
        torque[i] = data.qfrc_inverse - held
        base_wrench[i] = -data.sensordata
    return Readings(torque, base_wrench)
