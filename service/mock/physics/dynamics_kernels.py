"""Newton-Euler recursion over a chain of bodies, each in its own axes, and the mass matrix computed with it.

The same method as `contactsense.service.mock.arm.newton_euler`, but compiled and for one instant: a thousand
steps per second must leave processor time for other processes. It shares no code and no frames with
`kinematics`.
"""

from math import cos, sin, sqrt
from typing import NamedTuple

import numpy as np

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector
from contactsense.service.mock.physics.bodies import Bodies


class Scratch(NamedTuple):
    """Arrays that the kernels fill, for B bodies and n joints. Vectors of body j are in its own axes."""

    local: np.ndarray
    """Orientation of each body in its parent, shape (B, 3, 3); that of body 0 is unused."""
    rotation: np.ndarray
    """Orientation of each body in base axes, shape (B, 3, 3)."""
    origin: np.ndarray
    """Origin of each body in the base frame [m], shape (B, 3)."""
    omega: np.ndarray
    """Angular velocity [rad/s], shape (B, 3)."""
    velocity: np.ndarray
    """Velocity of the origin [m/s], shape (B, 3)."""
    alpha: np.ndarray
    """Angular acceleration [rad/s^2], shape (B, 3)."""
    accel: np.ndarray
    """Acceleration of the origin minus that of free fall [m/s^2], shape (B, 3)."""
    wrench: np.ndarray
    """Wrench of the parent on each body: force, then moment about its origin [N, Nm], shape (B, 6)."""
    load: np.ndarray
    """Wrench of the environment on each body: force, then moment about its origin [N, Nm], shape (B, 6)."""
    mass: np.ndarray
    """Mass matrix, shape (n, n) [kg m^2]."""
    factor: np.ndarray
    """Cholesky factor of the system matrix, shape (n, n)."""
    unit: np.ndarray
    """A unit joint acceleration, shape (n,)."""
    torque: np.ndarray
    """Joint torques, shape (n,) [Nm]."""


def scratch(count: int, joints: int) -> Scratch:
    """Allocate zeroed arrays for this number of bodies and moving joints."""
    vectors = [np.zeros((count, 3)) for _ in range(5)]
    rotation = np.tile(np.eye(3), (count, 1, 1))
    return Scratch(
        local=rotation.copy(),
        rotation=rotation,
        origin=vectors[0],
        omega=vectors[1],
        velocity=vectors[2],
        alpha=vectors[3],
        accel=vectors[4],
        wrench=np.zeros((count, 6)),
        load=np.zeros((count, 6)),
        mass=np.zeros((joints, joints)),
        factor=np.zeros((joints, joints)),
        unit=np.zeros(joints),
        torque=np.zeros(joints),
    )


@kernel
def turn(matrix: np.ndarray, x: float, y: float, z: float) -> Vector:
    """matrix @ (x, y, z)."""
    return (
        matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z,
        matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z,
        matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z,
    )


@kernel
def turn_back(matrix: np.ndarray, x: float, y: float, z: float) -> Vector:
    """matrix.T @ (x, y, z)."""
    return (
        matrix[0, 0] * x + matrix[1, 0] * y + matrix[2, 0] * z,
        matrix[0, 1] * x + matrix[1, 1] * y + matrix[2, 1] * z,
        matrix[0, 2] * x + matrix[1, 2] * y + matrix[2, 2] * z,
    )


@kernel
def cross(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> Vector:
    """Vector product."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@kernel
def set_poses(bodies: Bodies, q: np.ndarray, work: Scratch) -> None:
    """Fill `local`, `rotation` and `origin` for joint positions q [rad]; further joints are at 0."""
    for j in range(bodies.axis.shape[0]):
        angle = q[j] if j < q.shape[0] else 0.0
        x, y, z = bodies.axis[j, 0], bodies.axis[j, 1], bodies.axis[j, 2]
        c, s = cos(angle), sin(angle)
        v = 1.0 - c
        fixed, local = bodies.rotation[j], work.local[j + 1]
        for i in range(3):
            a, b, d = fixed[i, 0], fixed[i, 1], fixed[i, 2]
            # Row of fixed @ rotation about the axis (Rodrigues).
            local[i, 0] = a * (c + x * x * v) + b * (x * y * v + z * s) + d * (x * z * v - y * s)
            local[i, 1] = a * (x * y * v - z * s) + b * (c + y * y * v) + d * (y * z * v + x * s)
            local[i, 2] = a * (x * z * v + y * s) + b * (y * z * v - x * s) + d * (c + z * z * v)
        parent, own = work.rotation[j], work.rotation[j + 1]
        lever = bodies.translation[j]
        tx, ty, tz = turn(parent, lever[0], lever[1], lever[2])
        work.origin[j + 1, 0] = work.origin[j, 0] + tx
        work.origin[j + 1, 1] = work.origin[j, 1] + ty
        work.origin[j + 1, 2] = work.origin[j, 2] + tz
        for k in range(3):
            rx, ry, rz = turn(parent, local[0, k], local[1, k], local[2, k])
            own[0, k], own[1, k], own[2, k] = rx, ry, rz


@kernel
def set_velocities(bodies: Bodies, qd: np.ndarray, work: Scratch) -> None:
    """Fill `omega` and `velocity` for joint velocities qd [rad/s], after `set_poses`."""
    for j in range(bodies.axis.shape[0]):
        rate = qd[j] if j < qd.shape[0] else 0.0
        o, v, lever = work.omega[j], work.velocity[j], bodies.translation[j]
        cx, cy, cz = cross(o[0], o[1], o[2], lever[0], lever[1], lever[2])
        local = work.local[j + 1]
        vx, vy, vz = turn_back(local, v[0] + cx, v[1] + cy, v[2] + cz)
        ox, oy, oz = turn_back(local, o[0], o[1], o[2])
        own, moved = work.omega[j + 1], work.velocity[j + 1]
        own[0] = ox + rate * bodies.axis[j, 0]
        own[1] = oy + rate * bodies.axis[j, 1]
        own[2] = oz + rate * bodies.axis[j, 2]
        moved[0], moved[1], moved[2] = vx, vy, vz


@kernel
def inverse_dynamics(
    bodies: Bodies,
    moving: float,
    qdd: np.ndarray,
    fall: np.ndarray,
    loaded: float,
    work: Scratch,
    torque: np.ndarray,
) -> None:
    """Joint torques [Nm] for joint accelerations qdd [rad/s^2], after `set_poses` and `set_velocities`.

    Args:
        bodies: The chain.
        moving: 1.0: use the velocities of `work`; 0.0: treat all velocities as zero.
        qdd: Joint accelerations, shape (n,).
        fall: Acceleration of free fall, base axes [m/s^2], shape (3,).
        loaded: 1.0: include the loads of `work`; 0.0: omit them.
        work: `alpha`, `accel` and `wrench` are filled.
        torque: Filled with the joint torques, rotors included, shape (n,).
    """
    n, count = torque.shape[0], bodies.mass.shape[0]
    first, turned = work.accel[0], work.alpha[0]
    first[0], first[1], first[2] = -fall[0], -fall[1], -fall[2]
    turned[0] = turned[1] = turned[2] = 0.0
    for j in range(count):
        o, al, ac = work.omega[j], work.alpha[j], work.accel[j]
        if j > 0:
            local, lever = work.local[j], bodies.translation[j - 1]
            po, pl, pc = work.omega[j - 1], work.alpha[j - 1], work.accel[j - 1]
            lx, ly, lz = cross(pl[0], pl[1], pl[2], lever[0], lever[1], lever[2])
            wx, wy, wz = moving * po[0], moving * po[1], moving * po[2]
            sx, sy, sz = cross(wx, wy, wz, lever[0], lever[1], lever[2])
            sx, sy, sz = cross(wx, wy, wz, sx, sy, sz)
            ac[0], ac[1], ac[2] = turn_back(local, pc[0] + lx + sx, pc[1] + ly + sy, pc[2] + lz + sz)
            ax, ay, az = bodies.axis[j - 1, 0], bodies.axis[j - 1, 1], bodies.axis[j - 1, 2]
            cx, cy, cz = turn_back(local, wx, wy, wz)  # parent's angular velocity, own axes
            hx, hy, hz = moving * o[0] - cx, moving * o[1] - cy, moving * o[2] - cz
            gx, gy, gz = cross(cx, cy, cz, hx, hy, hz)
            bx, by, bz = turn_back(local, pl[0], pl[1], pl[2])
            rate = qdd[j - 1] if j - 1 < n else 0.0
            al[0], al[1], al[2] = bx + gx + rate * ax, by + gy + rate * ay, bz + gz + rate * az
        ox, oy, oz = moving * o[0], moving * o[1], moving * o[2]
        com, m, tensor, need = bodies.com[j], bodies.mass[j], bodies.inertia[j], work.wrench[j]
        ux, uy, uz = cross(al[0], al[1], al[2], com[0], com[1], com[2])
        vx, vy, vz = cross(ox, oy, oz, com[0], com[1], com[2])
        vx, vy, vz = cross(ox, oy, oz, vx, vy, vz)
        fx, fy, fz = m * (ac[0] + ux + vx), m * (ac[1] + uy + vy), m * (ac[2] + uz + vz)
        tx, ty, tz = turn(tensor, al[0], al[1], al[2])
        kx, ky, kz = turn(tensor, ox, oy, oz)
        kx, ky, kz = cross(ox, oy, oz, kx, ky, kz)
        mx, my, mz = cross(com[0], com[1], com[2], fx, fy, fz)
        load = work.load[j]
        need[0], need[1], need[2] = fx - loaded * load[0], fy - loaded * load[1], fz - loaded * load[2]
        need[3] = tx + kx + mx - loaded * load[3]
        need[4] = ty + ky + my - loaded * load[4]
        need[5] = tz + kz + mz - loaded * load[5]
    for j in range(count - 1, 0, -1):
        need, below = work.wrench[j], work.wrench[j - 1]
        if j - 1 < n:
            torque[j - 1] = (
                need[3] * bodies.axis[j - 1, 0]
                + need[4] * bodies.axis[j - 1, 1]
                + need[5] * bodies.axis[j - 1, 2]
                + bodies.rotor[j - 1] * qdd[j - 1]
            )
        local, lever = work.local[j], bodies.translation[j - 1]
        fx, fy, fz = turn(local, need[0], need[1], need[2])
        mx, my, mz = turn(local, need[3], need[4], need[5])
        cx, cy, cz = cross(lever[0], lever[1], lever[2], fx, fy, fz)
        below[0], below[1], below[2] = below[0] + fx, below[1] + fy, below[2] + fz
        below[3], below[4], below[5] = below[3] + mx + cx, below[4] + my + cy, below[5] + mz + cz


@kernel
def set_mass_matrix(bodies: Bodies, still: np.ndarray, work: Scratch) -> None:
    """Fill `mass`, column by column from the recursion; `still`: a zero vector of shape (3,)."""
    n = work.unit.shape[0]
    for k in range(n):
        for i in range(n):
            work.unit[i] = 1.0 if i == k else 0.0
        inverse_dynamics(bodies, 0.0, work.unit, still, 0.0, work, work.torque)
        for i in range(n):
            work.mass[i, k] = work.torque[i]


@kernel
def solve(
    matrix: np.ndarray, diagonal: np.ndarray, right: np.ndarray, factor: np.ndarray, out: np.ndarray
) -> None:
    """Solve (matrix + diag(diagonal)) out = right by Cholesky; all of size n, `factor` is overwritten."""
    n = right.shape[0]
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j] + (diagonal[i] if i == j else 0.0)
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            factor[i, j] = sqrt(total) if i == j else total / factor[j, j]
    for i in range(n):
        total = right[i]
        for k in range(i):
            total -= factor[i, k] * out[k]
        out[i] = total / factor[i, i]
    for i in range(n - 1, -1, -1):
        total = out[i]
        for k in range(i + 1, n):
            total -= factor[k, i] * out[k]
        out[i] = total / factor[i, i]
