"""Kinematics and momenta of eight samples at once, one in each lane of the processor's vector registers, with
the digits of `contactsense.kinematics.momenta.kinematics_and_momenta`.

The work array is flat. Each body has `BODY` numbers in it, base first; quantity Q of body b in lane k is at
index b BODY + Q + k. Loops over k are vectorized if they contain arithmetic only: all offsets within two
neighbouring bodies are compile-time constants.
"""

import numpy as np

from contactsense.kinematics.body_motion import (
    Rows,
    apply_inertia,
    matvec,
    momentum_of_body,
    point_in_base,
    product,
    rotation_about,
    rows_of,
    screw_rate,
    weight_of_body,
)
from contactsense.kinematics.model import Model, Motion
from contactsense.kinematics.spatial import Six
from contactsense.kinematics.trigonometry import sine_and_versine
from contactsense.robots.jit.array_views import view
from contactsense.robots.jit.kernel import inlined_kernel, kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.vectors import Vector, add_scaled, cross, vector

ANGLE, SPEED, ROTATION, ORIGIN, SCREW, SCREW_RATE, TWIST, MOMENTUM, GRAVITY, KINEMATICS = (
    LANES * start for start in (0, 1, 2, 11, 14, 20, 26, 32, 38, 44)
)
"""Offsets of a body's quantities. `ANGLE` and `SPEED`: position [rad] and velocity [rad/s] of the joint that
carries it. Then the fields of `contactsense.kinematics.model.Motion`, whose numbers follow each other, a
matrix row by row. `KINEMATICS`: length of all of them."""
BODY = 81 * LANES
"""Numbers of a body: these, and those of `contactsense.residuals.simd_equations`."""


def empty_lanes(joints: int) -> np.ndarray:
    """A work array for an arm with that many joints."""
    return np.zeros((joints + 1) * BODY + LANES)


@kernel
def kinematics_in_lanes(
    model: Model,
    gravity: np.ndarray,
    q: np.ndarray,
    qd: np.ndarray,
    first: int,
    lanes: np.ndarray,
) -> None:
    """Fill the work array for samples `first`, `first` + 1, ...; lanes beyond the last sample repeat it.

    Args:
        model: The arm.
        gravity: Base axes [m/s^2], shape (3,).
        q, qd: Joint positions [rad] and velocities [rad/s], shape (N, n).
        first: The first sample.
        lanes: Filled, see `empty_lanes`.
    """
    n, last = q.shape[1], q.shape[0] - 1
    base = view(lanes, 0, (BODY,))
    for k in range(ROTATION, MOMENTUM):
        base[k] = 0.0
    for k in range(LANES):
        put_rows(base, ROTATION + k, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    for j in range(n):
        body = view(lanes, (j + 1) * BODY, (BODY,))
        for k in range(LANES):
            i = min(first + k, last)
            body[ANGLE + k] = q[i, j]
            body[SPEED + k] = qd[i, j]
        _place_body(model, j, view(lanes, j * BODY, (2 * BODY,)))
    for j in range(n, -1, -1):
        here = view(lanes, j * BODY, (BODY,))
        _momentum_and_weight(model, j, gravity, here)
        if j < n:
            distal = view(lanes, (j + 1) * BODY, (BODY,))
            for k in range(MOMENTUM, KINEMATICS):
                here[k] += distal[k]


@kernel
def _place_body(model: Model, j: int, pair: np.ndarray) -> None:
    """Pose and twist of the body that joint j carries, the joint's screw and its rate; `pair`: its parent and
    itself."""
    translation, fixed, axis = vector(model.translation[j]), rows_of(model.rotation[j]), vector(model.axis[j])
    for k in range(LANES):
        parent = rows_at(pair, ROTATION + k)
        velocity, angular = vector_at(pair, TWIST + k), vector_at(pair, TWIST + 3 * LANES + k)
        angle, speed = pair[BODY + ANGLE + k], pair[BODY + SPEED + k]
        o = point_in_base(parent, vector_at(pair, ORIGIN + k), translation)
        before = product(parent, fixed)
        z = matvec(before, axis)
        m = cross(o, z)
        sine, versine = sine_and_versine(angle)
        rate = screw_rate(velocity, angular, m, z)
        put_vector(pair, BODY + ORIGIN + k, o)
        put_vector(pair, BODY + SCREW + k, m)
        put_vector(pair, BODY + SCREW + 3 * LANES + k, z)
        put_rows(pair, BODY + ROTATION + k, product(before, rotation_about(axis, sine, versine)))
        put_vector(pair, BODY + SCREW_RATE + k, rate[0])
        put_vector(pair, BODY + SCREW_RATE + 3 * LANES + k, rate[1])
        put_vector(pair, BODY + TWIST + k, add_scaled(velocity, speed, m))
        put_vector(pair, BODY + TWIST + 3 * LANES + k, add_scaled(angular, speed, z))


@kernel
def _momentum_and_weight(model: Model, j: int, gravity: np.ndarray, body: np.ndarray) -> None:
    """Momentum and gravity wrench of one body alone."""
    mass, com, inertia = model.mass[j], vector(model.com[j]), rows_of(model.inertia[j])
    g = vector(gravity)
    for k in range(LANES):
        R = rows_at(body, ROTATION + k)
        c = point_in_base(R, vector_at(body, ORIGIN + k), com)
        angular = vector_at(body, TWIST + 3 * LANES + k)
        spin = apply_inertia(R, inertia, angular)
        linear, turning = momentum_of_body(mass, c, spin, vector_at(body, TWIST + k), angular)
        force, moment = weight_of_body(mass, c, g)
        put_vector(body, MOMENTUM + k, linear)
        put_vector(body, MOMENTUM + 3 * LANES + k, turning)
        put_vector(body, GRAVITY + k, force)
        put_vector(body, GRAVITY + 3 * LANES + k, moment)


@inlined_kernel
def vector_at(body: np.ndarray, at: int) -> Vector:
    """Three numbers of a lane, the first at an index."""
    return body[at], body[at + LANES], body[at + 2 * LANES]


@inlined_kernel
def six_at(body: np.ndarray, at: int) -> Six:
    """Six numbers of a lane, the first at an index."""
    return (*vector_at(body, at), *vector_at(body, at + 3 * LANES))


@inlined_kernel
def put_vector(body: np.ndarray, at: int, v: Vector) -> None:
    """Store three numbers of a lane, the first at an index."""
    body[at], body[at + LANES], body[at + 2 * LANES] = v


@inlined_kernel
def rows_at(body: np.ndarray, at: int) -> Rows:
    """Nine numbers of a lane, the first at an index, as a matrix."""
    return vector_at(body, at), vector_at(body, at + 3 * LANES), vector_at(body, at + 6 * LANES)


@inlined_kernel
def put_rows(body: np.ndarray, at: int, rows: Rows) -> None:
    """Store a matrix as nine numbers of a lane, the first at an index."""
    put_vector(body, at, rows[0])
    put_vector(body, at + 3 * LANES, rows[1])
    put_vector(body, at + 6 * LANES, rows[2])


@kernel
def motion_of_lane(lanes: np.ndarray, lane: int, motion: Motion) -> None:
    """Fill `motion` with one lane of the work array.

    Args:
        lanes: After `kinematics_in_lanes`.
        lane: Which.
        motion: Filled.
    """
    for b in range(motion.rotation.shape[0]):
        body = view(lanes, b * BODY + lane, (BODY,))
        for i in range(3):
            for k in range(3):
                motion.rotation[b, i, k] = body[ROTATION + LANES * (3 * i + k)]
            motion.origin[b, i] = body[ORIGIN + LANES * i]
        for i in range(6):
            motion.twist[b, i] = body[TWIST + LANES * i]
            motion.momentum[b, i] = body[MOMENTUM + LANES * i]
            motion.gravity[b, i] = body[GRAVITY + LANES * i]
            if b > 0:
                motion.screw[b - 1, i] = body[SCREW + LANES * i]
                motion.screw_rate[b - 1, i] = body[SCREW_RATE + LANES * i]
