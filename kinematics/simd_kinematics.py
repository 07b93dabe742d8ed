"""Kinematics and momenta of eight samples at once, one in each lane of the processor's vector registers, with
the digits of `contactsense.kinematics.momenta.kinematics_and_momenta`.

The work array is flat. Each body has `BODY` numbers in it, base first; quantity Q of body b in lane k is at
index b BODY + Q + k. Loops over k are vectorized if they contain arithmetic only: all offsets within two
neighbouring bodies are compile-time constants.
"""

import numpy as np

from contactsense.kinematics.model import Model, Motion
from contactsense.kinematics.trigonometry import sine_and_versine
from contactsense.robots.jit.array_views import view
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.jit.lanes import LANES

(
    ANGLE, SPEED,
    R00, R01, R02, R10, R11, R12, R20, R21, R22, OX, OY, OZ,
    S0, S1, S2, S3, S4, S5,
    A0, A1, A2, A3, A4, A5,
    V0, V1, V2, V3, V4, V5,
    H0, H1, H2, H3, H4, H5,
    G0, G1, G2, G3, G4, G5,
) = range(0, 44 * LANES, LANES)  # fmt: skip
"""Offsets of a body's quantities. `ANGLE` and `SPEED`: position [rad] and velocity [rad/s] of the joint that
carries it. Then the fields of `contactsense.kinematics.model.Motion`:
`R00` to `R22` rotation, `OX` to `OZ` origin, `S0` to `S5` the joint's screw, `A0` to `A5` its rate, `V0` to
`V5` twist, `H0` to `H5` momentum, `G0` to `G5` gravity."""
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
    for k in range(R00, V5 + LANES):
        base[k] = 0.0
    for k in range(LANES):
        base[R00 + k] = 1.0
        base[R11 + k] = 1.0
        base[R22 + k] = 1.0
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
            for k in range(H0, G5 + LANES):
                here[k] += distal[k]


@kernel
def _place_body(model: Model, j: int, pair: np.ndarray) -> None:
    """Pose and twist of the body that joint j carries, the joint's screw and its rate; `pair`: its parent and
    itself."""
    tx, ty, tz = model.translation[j, 0], model.translation[j, 1], model.translation[j, 2]
    m00, m01, m02 = model.rotation[j, 0, 0], model.rotation[j, 0, 1], model.rotation[j, 0, 2]
    m10, m11, m12 = model.rotation[j, 1, 0], model.rotation[j, 1, 1], model.rotation[j, 1, 2]
    m20, m21, m22 = model.rotation[j, 2, 0], model.rotation[j, 2, 1], model.rotation[j, 2, 2]
    x, y, z = model.axis[j, 0], model.axis[j, 1], model.axis[j, 2]
    for k in range(LANES):
        p00, p01, p02 = pair[R00 + k], pair[R01 + k], pair[R02 + k]
        p10, p11, p12 = pair[R10 + k], pair[R11 + k], pair[R12 + k]
        p20, p21, p22 = pair[R20 + k], pair[R21 + k], pair[R22 + k]
        ox = pair[OX + k] + p00 * tx + p01 * ty + p02 * tz
        oy = pair[OY + k] + p10 * tx + p11 * ty + p12 * tz
        oz = pair[OZ + k] + p20 * tx + p21 * ty + p22 * tz
        b00, b01, b02 = (
            p00 * m00 + p01 * m10 + p02 * m20,
            p00 * m01 + p01 * m11 + p02 * m21,
            p00 * m02 + p01 * m12 + p02 * m22,
        )
        b10, b11, b12 = (
            p10 * m00 + p11 * m10 + p12 * m20,
            p10 * m01 + p11 * m11 + p12 * m21,
            p10 * m02 + p11 * m12 + p12 * m22,
        )
        b20, b21, b22 = (
            p20 * m00 + p21 * m10 + p22 * m20,
            p20 * m01 + p21 * m11 + p22 * m21,
            p20 * m02 + p21 * m12 + p22 * m22,
        )
        zx, zy, zz = b00 * x + b01 * y + b02 * z, b10 * x + b11 * y + b12 * z, b20 * x + b21 * y + b22 * z
        ax, ay, az = oy * zz - oz * zy, oz * zx - ox * zz, ox * zy - oy * zx
        pair[BODY + OX + k], pair[BODY + OY + k], pair[BODY + OZ + k] = ox, oy, oz
        pair[BODY + S0 + k], pair[BODY + S1 + k], pair[BODY + S2 + k] = ax, ay, az
        pair[BODY + S3 + k], pair[BODY + S4 + k], pair[BODY + S5 + k] = zx, zy, zz
        s, v = sine_and_versine(pair[BODY + ANGLE + k])
        r00, r01, r02 = 1.0 - v * (y * y + z * z), v * x * y - s * z, v * x * z + s * y
        r10, r11, r12 = v * x * y + s * z, 1.0 - v * (x * x + z * z), v * y * z - s * x
        r20, r21, r22 = v * x * z - s * y, v * y * z + s * x, 1.0 - v * (x * x + y * y)
        pair[BODY + R00 + k] = b00 * r00 + b01 * r10 + b02 * r20
        pair[BODY + R01 + k] = b00 * r01 + b01 * r11 + b02 * r21
        pair[BODY + R02 + k] = b00 * r02 + b01 * r12 + b02 * r22
        pair[BODY + R10 + k] = b10 * r00 + b11 * r10 + b12 * r20
        pair[BODY + R11 + k] = b10 * r01 + b11 * r11 + b12 * r21
        pair[BODY + R12 + k] = b10 * r02 + b11 * r12 + b12 * r22
        pair[BODY + R20 + k] = b20 * r00 + b21 * r10 + b22 * r20
        pair[BODY + R21 + k] = b20 * r01 + b21 * r11 + b22 * r21
        pair[BODY + R22 + k] = b20 * r02 + b21 * r12 + b22 * r22
        vx, vy, vz = pair[V0 + k], pair[V1 + k], pair[V2 + k]
        wx, wy, wz = pair[V3 + k], pair[V4 + k], pair[V5 + k]
        pair[BODY + A0 + k] = wy * az - wz * ay + vy * zz - vz * zy
        pair[BODY + A1 + k] = wz * ax - wx * az + vz * zx - vx * zz
        pair[BODY + A2 + k] = wx * ay - wy * ax + vx * zy - vy * zx
        pair[BODY + A3 + k] = wy * zz - wz * zy
        pair[BODY + A4 + k] = wz * zx - wx * zz
        pair[BODY + A5 + k] = wx * zy - wy * zx
        speed = pair[BODY + SPEED + k]
        pair[BODY + V0 + k], pair[BODY + V1 + k], pair[BODY + V2 + k] = (
            vx + ax * speed,
            vy + ay * speed,
            vz + az * speed,
        )
        pair[BODY + V3 + k], pair[BODY + V4 + k], pair[BODY + V5 + k] = (
            wx + zx * speed,
            wy + zy * speed,
            wz + zz * speed,
        )


@kernel
def _momentum_and_weight(model: Model, j: int, gravity: np.ndarray, body: np.ndarray) -> None:
    """Momentum and gravity wrench of one body alone."""
    mass, c0, c1, c2 = model.mass[j], model.com[j, 0], model.com[j, 1], model.com[j, 2]
    i00, i01, i02 = model.inertia[j, 0, 0], model.inertia[j, 0, 1], model.inertia[j, 0, 2]
    i10, i11, i12 = model.inertia[j, 1, 0], model.inertia[j, 1, 1], model.inertia[j, 1, 2]
    i20, i21, i22 = model.inertia[j, 2, 0], model.inertia[j, 2, 1], model.inertia[j, 2, 2]
    fx, fy, fz = mass * gravity[0], mass * gravity[1], mass * gravity[2]
    for k in range(LANES):
        r00, r01, r02 = body[R00 + k], body[R01 + k], body[R02 + k]
        r10, r11, r12 = body[R10 + k], body[R11 + k], body[R12 + k]
        r20, r21, r22 = body[R20 + k], body[R21 + k], body[R22 + k]
        cx = body[OX + k] + r00 * c0 + r01 * c1 + r02 * c2
        cy = body[OY + k] + r10 * c0 + r11 * c1 + r12 * c2
        cz = body[OZ + k] + r20 * c0 + r21 * c1 + r22 * c2
        wx, wy, wz = body[V3 + k], body[V4 + k], body[V5 + k]
        hx = mass * (body[V0 + k] + wy * cz - wz * cy)
        hy = mass * (body[V1 + k] + wz * cx - wx * cz)
        hz = mass * (body[V2 + k] + wx * cy - wy * cx)
        bx, by, bz = (
            r00 * wx + r10 * wy + r20 * wz,
            r01 * wx + r11 * wy + r21 * wz,
            r02 * wx + r12 * wy + r22 * wz,
        )
        sx, sy, sz = (
            i00 * bx + i01 * by + i02 * bz,
            i10 * bx + i11 * by + i12 * bz,
            i20 * bx + i21 * by + i22 * bz,
        )
        lx, ly, lz = (
            r00 * sx + r01 * sy + r02 * sz,
            r10 * sx + r11 * sy + r12 * sz,
            r20 * sx + r21 * sy + r22 * sz,
        )
        body[H0 + k], body[H1 + k], body[H2 + k] = hx, hy, hz
        body[H3 + k] = lx + cy * hz - cz * hy
        body[H4 + k] = ly + cz * hx - cx * hz
        body[H5 + k] = lz + cx * hy - cy * hx
        body[G0 + k], body[G1 + k], body[G2 + k] = fx, fy, fz
        body[G3 + k] = cy * fz - cz * fy
        body[G4 + k] = cz * fx - cx * fz
        body[G5 + k] = cx * fy - cy * fx


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
                motion.rotation[b, i, k] = body[R00 + LANES * (3 * i + k)]
            motion.origin[b, i] = body[OX + LANES * i]
        for i in range(6):
            motion.twist[b, i] = body[V0 + LANES * i]
            motion.momentum[b, i] = body[H0 + LANES * i]
            motion.gravity[b, i] = body[G0 + LANES * i]
            if b > 0:
                motion.screw[b - 1, i] = body[S0 + LANES * i]
                motion.screw_rate[b - 1, i] = body[A0 + LANES * i]
