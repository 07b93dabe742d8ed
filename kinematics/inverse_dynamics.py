"""Inverse dynamics, for simulation and tests; the estimator itself needs no accelerations.

All quantities are in base axes, moments and angular momenta about the base origin. A wrench is (force,
moment). The kernels fill arrays of the caller and allocate nothing. They do not check shapes; callers do.
"""

import numpy as np

from contactsense.kinematics.model import Model, Motion
from contactsense.kinematics.momenta import apply_inertia, com_in_base, kinematics_and_momenta
from contactsense.kinematics.spatial import dot6
from contactsense.robots.jit.kernel import kernel


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
    twist, screw, rate = motion.twist, motion.screw, motion.screw_rate
    # Acceleration of each link: time derivative of its twist at the base origin, summed outward here
    base_wrench[:] = 0.0
    acceleration = base_wrench
    for j in range(n):
        for i in range(6):
            acceleration[i] += screw[j, i] * qdd[j] + rate[j, i] * qd[j]
    # and subtracted joint by joint in the inward pass, so that no array of accelerations is needed.
    fx = fy = fz = mx = my = mz = 0.0
    for j in range(n, -1, -1):
        c = com_in_base(motion.rotation[j], model.com[j], motion.origin[j])
        m = model.mass[j]
        vx, vy, vz = twist[j, 0], twist[j, 1], twist[j, 2]
        wx, wy, wz = twist[j, 3], twist[j, 4], twist[j, 5]
        ax, ay, az = acceleration[3], acceleration[4], acceleration[5]
        # Velocity and acceleration of the centre of mass.
        ux, uy, uz = vx + wy * c[2] - wz * c[1], vy + wz * c[0] - wx * c[2], vz + wx * c[1] - wy * c[0]
        px = m * (acceleration[0] + ay * c[2] - az * c[1] + wy * uz - wz * uy)
        py = m * (acceleration[1] + az * c[0] - ax * c[2] + wz * ux - wx * uz)
        pz = m * (acceleration[2] + ax * c[1] - ay * c[0] + wx * uy - wy * ux)
        lx, ly, lz = apply_inertia(motion.rotation[j], model.inertia[j], wx, wy, wz)
        kx, ky, kz = apply_inertia(motion.rotation[j], model.inertia[j], ax, ay, az)
        fx += px
        fy += py
        fz += pz
        mx += kx + wy * lz - wz * ly + c[1] * pz - c[2] * py
        my += ky + wz * lx - wx * lz + c[2] * px - c[0] * pz
        mz += kz + wx * ly - wy * lx + c[0] * py - c[1] * px
        if j > 0:
            s = screw[j - 1]
            torque[j - 1] = (
                s[0] * fx
                + s[1] * fy
                + s[2] * fz
                + s[3] * mx
                + s[4] * my
                + s[5] * mz
                - dot6(s, motion.gravity[j])
                + model.rotor_inertia[j - 1] * qdd[j - 1]
            )
            for i in range(6):
                acceleration[i] -= s[i] * qdd[j - 1] + rate[j - 1, i] * qd[j - 1]
    base_wrench[0] = motion.gravity[0, 0] - fx
    base_wrench[1] = motion.gravity[0, 1] - fy
    base_wrench[2] = motion.gravity[0, 2] - fz
    base_wrench[3] = motion.gravity[0, 3] - mx
    base_wrench[4] = motion.gravity[0, 4] - my
    base_wrench[5] = motion.gravity[0, 5] - mz
