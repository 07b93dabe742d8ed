"""Kernels: one outward pass and one suffix sum give poses, screws, momenta and gravity wrenches (theory,
sections 1, 2).

All quantities are in base axes, moments and angular momenta about the base origin. A wrench is (force,
moment). No accelerations are needed for the external wrench; `inverse_dynamics` exists for simulation and for
checks. The kernels fill arrays that the caller owns and allocate nothing. They trust their arguments: shapes
are checked above.
"""

import math

import numpy as np

from kinematics.model import Model, Motion
from robots.compiled import kernel


@kernel
def _rotate_about(axis: np.ndarray, angle: float, before: np.ndarray, after: np.ndarray) -> None:
    """Set `after = before @ Rot(axis, angle)` by Rodrigues' formula."""
    s = math.sin(angle)
    v = 2.0 * math.sin(0.5 * angle) ** 2  # 1 - cos, exact for small angles
    x, y, z = axis[0], axis[1], axis[2]
    r00 = 1.0 - v * (y * y + z * z)
    r01 = v * x * y - s * z
    r02 = v * x * z + s * y
    r10 = v * x * y + s * z
    r11 = 1.0 - v * (x * x + z * z)
    r12 = v * y * z - s * x
    r20 = v * x * z - s * y
    r21 = v * y * z + s * x
    r22 = 1.0 - v * (x * x + y * y)
    for i in range(3):
        b0, b1, b2 = before[i, 0], before[i, 1], before[i, 2]
        after[i, 0] = b0 * r00 + b1 * r10 + b2 * r20
        after[i, 1] = b0 * r01 + b1 * r11 + b2 * r21
        after[i, 2] = b0 * r02 + b1 * r12 + b2 * r22


@kernel
def place(model: Model, q: np.ndarray, motion: Motion) -> None:
    """Forward kinematics: fill `rotation`, `origin` and `screw` of `motion` for joint positions q [rad]."""
    rotation, origin, screw = motion.rotation, motion.origin, motion.screw
    for i in range(3):
        for k in range(3):
            rotation[0, i, k] = 1.0 if i == k else 0.0
        origin[0, i] = 0.0
    for j in range(q.shape[0]):
        parent = rotation[j]
        child = rotation[j + 1]
        for i in range(3):
            origin[j + 1, i] = (
                origin[j, i]
                + parent[i, 0] * model.translation[j, 0]
                + parent[i, 1] * model.translation[j, 1]
                + parent[i, 2] * model.translation[j, 2]
            )
            for k in range(3):
                child[i, k] = (
                    parent[i, 0] * model.rotation[j, 0, k]
                    + parent[i, 1] * model.rotation[j, 1, k]
                    + parent[i, 2] * model.rotation[j, 2, k]
                )
        axis = model.axis[j]
        zx = child[0, 0] * axis[0] + child[0, 1] * axis[1] + child[0, 2] * axis[2]
        zy = child[1, 0] * axis[0] + child[1, 1] * axis[1] + child[1, 2] * axis[2]
        zz = child[2, 0] * axis[0] + child[2, 1] * axis[1] + child[2, 2] * axis[2]
        ox, oy, oz = origin[j + 1, 0], origin[j + 1, 1], origin[j + 1, 2]
        screw[j, 0] = oy * zz - oz * zy
        screw[j, 1] = oz * zx - ox * zz
        screw[j, 2] = ox * zy - oy * zx
        screw[j, 3] = zx
        screw[j, 4] = zy
        screw[j, 5] = zz
        _rotate_about(axis, q[j], child, child)


@kernel
def move(model: Model, q: np.ndarray, qd: np.ndarray, gravity: np.ndarray, motion: Motion) -> None:
    """Fill all of `motion` for joint positions q [rad], velocities qd [rad/s] and gravity in base axes
    [m/s^2]."""
    place(model, q, motion)
    n = q.shape[0]
    twist, screw, rate = motion.twist, motion.screw, motion.screw_rate
    for i in range(6):
        twist[0, i] = 0.0
    for j in range(n):
        vx, vy, vz = twist[j, 0], twist[j, 1], twist[j, 2]
        wx, wy, wz = twist[j, 3], twist[j, 4], twist[j, 5]
        ax, ay, az = screw[j, 0], screw[j, 1], screw[j, 2]
        zx, zy, zz = screw[j, 3], screw[j, 4], screw[j, 5]
        # The parent's motion carries the screw: its axis turns, its moment part also moves with the parent.
        rate[j, 0] = wy * az - wz * ay + vy * zz - vz * zy
        rate[j, 1] = wz * ax - wx * az + vz * zx - vx * zz
        rate[j, 2] = wx * ay - wy * ax + vx * zy - vy * zx
        rate[j, 3] = wy * zz - wz * zy
        rate[j, 4] = wz * zx - wx * zz
        rate[j, 5] = wx * zy - wy * zx
        for i in range(6):
            twist[j + 1, i] = twist[j, i] + screw[j, i] * qd[j]
    _accumulate(model, gravity, motion)


@kernel
def _accumulate(model: Model, gravity: np.ndarray, motion: Motion) -> None:
    """Suffix sums of momentum and gravity wrench, from the last link to the base."""
    momentum, weight = motion.momentum, motion.gravity
    last = momentum.shape[0] - 1
    for j in range(last, -1, -1):
        carry(
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


@kernel
def carry(
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
    cx, cy, cz = _center(rotation, com, origin)
    vx, vy, vz = twist[0], twist[1], twist[2]
    wx, wy, wz = twist[3], twist[4], twist[5]
    hx = mass * (vx + wy * cz - wz * cy)
    hy = mass * (vy + wz * cx - wx * cz)
    hz = mass * (vz + wx * cy - wy * cx)
    lx, ly, lz = _spin(rotation, inertia, wx, wy, wz)
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


@kernel
def _center(R: np.ndarray, c: np.ndarray, o: np.ndarray) -> tuple[float, float, float]:
    """The body-frame point c in the base frame [m]."""
    return (
        o[0] + R[0, 0] * c[0] + R[0, 1] * c[1] + R[0, 2] * c[2],
        o[1] + R[1, 0] * c[0] + R[1, 1] * c[1] + R[1, 2] * c[2],
        o[2] + R[2, 0] * c[0] + R[2, 1] * c[1] + R[2, 2] * c[2],
    )


@kernel
def _spin(R: np.ndarray, J: np.ndarray, x: float, y: float, z: float) -> tuple[float, float, float]:
    """R J R^T times the vector (x, y, z): an inertia tensor given in body axes, applied in base axes."""
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


@kernel
def dot6(a: np.ndarray, b: np.ndarray) -> float:
    """Scalar product of two 6-vectors, a screw with a wrench or a momentum."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5])


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
    """Joint torques [Nm] and wrench of the arm on the sensor below it [N, Nm] for a motion without contact.

    Fills `torque` (n,) and `base_wrench` (6,), and `motion` on the way:
    tau_j = s_j . (dH_j/dt - G_j), y = G_0 - dH_0/dt.
    """
    move(model, q, qd, gravity, motion)
    n = q.shape[0]
    twist, screw, rate = motion.twist, motion.screw, motion.screw_rate
    # Acceleration of each link: time derivative of its twist at the base origin. It is summed outward
    # first,
    base_wrench[:] = 0.0
    acceleration = base_wrench
    for j in range(n):
        for i in range(6):
            acceleration[i] += screw[j, i] * qdd[j] + rate[j, i] * qd[j]
    # and taken off again joint by joint on the way back, so that no array of accelerations is needed.
    fx = fy = fz = mx = my = mz = 0.0
    for j in range(n, -1, -1):
        c = _center(motion.rotation[j], model.com[j], motion.origin[j])
        m = model.mass[j]
        vx, vy, vz = twist[j, 0], twist[j, 1], twist[j, 2]
        wx, wy, wz = twist[j, 3], twist[j, 4], twist[j, 5]
        ax, ay, az = acceleration[3], acceleration[4], acceleration[5]
        # Velocity and acceleration of the centre of mass.
        ux, uy, uz = vx + wy * c[2] - wz * c[1], vy + wz * c[0] - wx * c[2], vz + wx * c[1] - wy * c[0]
        px = m * (acceleration[0] + ay * c[2] - az * c[1] + wy * uz - wz * uy)
        py = m * (acceleration[1] + az * c[0] - ax * c[2] + wz * ux - wx * uz)
        pz = m * (acceleration[2] + ax * c[1] - ay * c[0] + wx * uy - wy * ux)
        lx, ly, lz = _spin(motion.rotation[j], model.inertia[j], wx, wy, wz)
        kx, ky, kz = _spin(motion.rotation[j], model.inertia[j], ax, ay, az)
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
