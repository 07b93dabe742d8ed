"""Inverse dynamics, for simulation and tests; the estimator itself needs no accelerations.

All quantities are in base axes, moments and angular momenta about the base origin. A wrench is (force,
moment). The kernels fill arrays of the caller and allocate nothing. They do not check shapes; callers do.
"""

import numpy as np

from contactsense.kinematics.body_motion import apply_inertia, point_in_base, rows_of
from contactsense.kinematics.model import Model, Motion
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.kinematics.spatial import dot6
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import add, add_cross, scale, vector


@kernel
def inverse_dynamics(
    model: Model,
    q: np.ndarray,
    qd: np.ndarray,
    qdd: np.ndarray,
    gravity: np.ndarray,
    motion: Motion,
    torque: np.ndarray,
    base_wrench: np.ndarray,
) -> None:
    """Joint torques [Nm] and wrench of the arm on the base sensor [N, Nm] for a motion without contact.

    Fills `torque` (n,), `base_wrench` (6,) and `motion`: tau_j = s_j . (dH_j/dt - G_j), y = G_0 - dH_0/dt.
    """
    kinematics_and_momenta(model, q, qd, gravity, motion)
    n = q.shape[0]
    twist, screw, screw_rate = motion.twist, motion.screw, motion.screw_rate
    # Acceleration of each link: time derivative of its twist at the base origin, summed outward here
    base_wrench[:] = 0.0
    acceleration = base_wrench
    for j in range(n):
        for i in range(6):
            acceleration[i] += screw[j, i] * qdd[j] + screw_rate[j, i] * qd[j]
    # and subtracted joint by joint in the inward pass, so that no array of accelerations is needed.
    force, moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for j in range(n, -1, -1):
        R, inertia = rows_of(motion.rotation[j]), rows_of(model.inertia[j])
        c = point_in_base(R, vector(motion.origin[j]), vector(model.com[j]))
        w, alpha = vector(twist[j, 3:]), vector(acceleration[3:])
        velocity_of_com = add_cross(vector(twist[j]), w, c)
        acceleration_of_com = add_cross(add_cross(vector(acceleration), alpha, c), w, velocity_of_com)
        rate = scale(model.mass[j], acceleration_of_com)
        spin, spin_rate = apply_inertia(R, inertia, w), apply_inertia(R, inertia, alpha)
        force = add(force, rate)
        moment = add(moment, add_cross(add_cross(spin_rate, w, spin), c, rate))
        if j > 0:
            s = screw[j - 1]
            torque[j - 1] = (
                dot6(s, (*force, *moment))
                - dot6(s, motion.gravity[j])
                + model.rotor_inertia[j - 1] * qdd[j - 1]
            )
            for i in range(6):
                acceleration[i] -= s[i] * qdd[j - 1] + screw_rate[j - 1, i] * qd[j - 1]
    for i in range(3):
        base_wrench[i] = motion.gravity[0, i] - force[i]
        base_wrench[3 + i] = motion.gravity[0, 3 + i] - moment[i]
