"""Twists, momenta and gravity wrenches of all links: one outward pass and one suffix sum.

All quantities are in base axes, moments and angular momenta about the base origin. A wrench is (force,
moment). The kernels fill arrays of the caller and allocate nothing. They do not check shapes; callers do.
"""

import numpy as np

from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import Model, Motion
from contactsense.robots.jit.kernel import inlined_kernel, kernel


@kernel
def kinematics_and_momenta(
    model: Model, q: np.ndarray, qd: np.ndarray, gravity: np.ndarray, motion: Motion
) -> None:
    """Fill all of `motion` for joint positions q [rad], velocities qd [rad/s] and gravity in base axes
    [m/s^2]."""
    forward_kinematics(model, q, motion)
    n = q.shape[0]
    twist, screw, rate = motion.twist, motion.screw, motion.screw_rate
    for i in range(6):
        twist[0, i] = 0.0
    for j in range(n):
        vx, vy, vz = twist[j, 0], twist[j, 1], twist[j, 2]
        wx, wy, wz = twist[j, 3], twist[j, 4], twist[j, 5]
        ax, ay, az = screw[j, 0], screw[j, 1], screw[j, 2]
        zx, zy, zz = screw[j, 3], screw[j, 4], screw[j, 5]
        # The screw moves with the parent's twist.
        rate[j, 0] = wy * az - wz * ay + vy * zz - vz * zy
        rate[j, 1] = wz * ax - wx * az + vz * zx - vx * zz
        rate[j, 2] = wx * ay - wy * ax + vx * zy - vy * zx
        rate[j, 3] = wy * zz - wz * zy
        rate[j, 4] = wz * zx - wx * zz
        rate[j, 5] = wx * zy - wy * zx
        for i in range(6):
            twist[j + 1, i] = twist[j, i] + screw[j, i] * qd[j]
    _sum_inward(model, gravity, motion)


@inlined_kernel
def _sum_inward(model: Model, gravity: np.ndarray, motion: Motion) -> None:
    """Suffix sums of momentum and gravity wrench, from the last link to the base."""
    momentum, weight = motion.momentum, motion.gravity
    last = momentum.shape[0] - 1
    for j in range(last, -1, -1):
        body_momentum_and_weight(
            model.mass[j],
            model.com[j],
            model.inertia[j],
            motion.rotation[j],
            motion.origin[j],
            motion.twist[j],
            gravity,
            momentum[j],
            weight[j],
        )
        if j < last:
            for i in range(6):
                momentum[j, i] += momentum[j + 1, i]
                weight[j, i] += weight[j + 1, i]


@inlined_kernel
def body_momentum_and_weight(
    mass: float,
    com: np.ndarray,
    inertia: np.ndarray,
    rotation: np.ndarray,
    origin: np.ndarray,
    twist: np.ndarray,
    gravity: np.ndarray,
    momentum: np.ndarray,
    weight: np.ndarray,
) -> None:
    """Momentum and gravity wrench of one body, about the base origin.

    Args:
        mass, com, inertia: Of the body, in a frame fixed to it: [kg], [m] (3,), about its com [kg m^2] (3,
            3).
        rotation, origin: That frame in the base frame, (3, 3) and (3,) [m].
        twist: Velocity of the body at the base origin [m/s] and angular velocity [rad/s], base axes, (6,).
        gravity: In base axes (3,) [m/s^2].
        momentum: Filled: linear and angular momentum (6,).
        weight: Filled: gravity wrench (6,).
    """
    cx, cy, cz = com_in_base(rotation, com, origin)
    vx, vy, vz = twist[0], twist[1], twist[2]
    wx, wy, wz = twist[3], twist[4], twist[5]
    hx = mass * (vx + wy * cz - wz * cy)
    hy = mass * (vy + wz * cx - wx * cz)
    hz = mass * (vz + wx * cy - wy * cx)
    lx, ly, lz = apply_inertia(rotation, inertia, wx, wy, wz)
    fx, fy, fz = mass * gravity[0], mass * gravity[1], mass * gravity[2]
    momentum[0] = hx
    momentum[1] = hy
    momentum[2] = hz
    momentum[3] = lx + cy * hz - cz * hy
    momentum[4] = ly + cz * hx - cx * hz
    momentum[5] = lz + cx * hy - cy * hx
    weight[0] = fx
    weight[1] = fy
    weight[2] = fz
    weight[3] = cy * fz - cz * fy
    weight[4] = cz * fx - cx * fz
    weight[5] = cx * fy - cy * fx


@inlined_kernel
def com_in_base(R: np.ndarray, c: np.ndarray, o: np.ndarray) -> tuple[float, float, float]:
    """Transform the body-frame point c to the base frame [m]."""
    return (
        o[0] + R[0, 0] * c[0] + R[0, 1] * c[1] + R[0, 2] * c[2],
        o[1] + R[1, 0] * c[0] + R[1, 1] * c[1] + R[1, 2] * c[2],
        o[2] + R[2, 0] * c[0] + R[2, 1] * c[1] + R[2, 2] * c[2],
    )


@inlined_kernel
def apply_inertia(R: np.ndarray, J: np.ndarray, x: float, y: float, z: float) -> tuple[float, float, float]:
    """R J R^T times the vector (x, y, z): an inertia tensor in body axes applied to a vector in base axes."""
    bx = R[0, 0] * x + R[1, 0] * y + R[2, 0] * z
    by = R[0, 1] * x + R[1, 1] * y + R[2, 1] * z
    bz = R[0, 2] * x + R[1, 2] * y + R[2, 2] * z
    sx = J[0, 0] * bx + J[0, 1] * by + J[0, 2] * bz
    sy = J[1, 0] * bx + J[1, 1] * by + J[1, 2] * bz
    sz = J[2, 0] * bx + J[2, 1] * by + J[2, 2] * bz
    return (
        R[0, 0] * sx + R[0, 1] * sy + R[0, 2] * sz,
        R[1, 0] * sx + R[1, 1] * sy + R[1, 2] * sz,
        R[2, 0] * sx + R[2, 1] * sy + R[2, 2] * sz,
    )
