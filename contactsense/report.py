"""Explanations as rows of numbers, the form in which they leave the compiled part."""

import numpy as np

from contactsense.arm import Arm
from contactsense.memory import Memory
from robots.compiled import inlined_kernel, kernel
from robots.grid import Grids, slide

LINK, PRIMITIVE, PROBABILITY, TORSION = 0, 1, 2, 3
POINT, POINT_BASE, NORMAL, FORCE = slice(4, 7), slice(7, 10), slice(10, 13), slice(13, 16)
COVARIANCE = slice(16, 25)
NUMBERS, VECTORS = slice(0, 4), slice(4, 25)
WIDTH = 25
"""Columns of a row: number of the link; number of the primitive among all; probability; torsion [Nm]; point
in the frame of the body that carries the link, point in the base frame [m]; normal; force [N]; covariance of
the point [m^2]. `NUMBERS` are the first four, `VECTORS` the seven rows of three that follow."""

SLIDE_STEPS = 5
"""Newton steps to the skin along the line of a force."""
REACHED = 1e-4
"""Distance from the skin that counts as having reached it [m]."""
LEAST_PROBABILITY = 0.01
"""Explanations less probable than this are not listed."""


@inlined_kernel
def report(arm: Arm, memory: Memory, skin: Grids, count: int, rows: np.ndarray) -> int:
    """Write the first `count` explanations in `memory` that are probable enough; returns how many.

    Where `skin` knows the link, place and normal are those where the force's line crosses it: a force may be
    shifted along its line without changing its wrench, so that place explains the measurement as well.
    """
    found = memory.found
    listed = 0
    for k in range(count):
        p = found.order[k]
        if found.probability[p] < LEAST_PROBABILITY:
            break
        write_row(
            arm,
            memory,
            skin,
            found.primitive[p],
            found.probability[p],
            found.torsion[p],
            found.point[p],
            found.normal[p],
            found.force[p],
            found.covariance[p],
            rows[k],
        )
        listed += 1
    return listed


@kernel
def write_row(arm, memory, skin, primitive, probability, torsion, point, normal, force, covariance, row):  # type: ignore[no-untyped-def]
    """Write one contact, base frame, as a row, its place on the skin where there is one."""
    link = arm.surfaces.link[primitive]
    body = arm.sensors.depth[link]
    R, o = memory.motion.rotation[body], memory.motion.origin[body]
    row[0] = link
    row[1] = primitive
    row[2] = probability
    row[3] = torsion
    dx, dy, dz = point[0] - o[0], point[1] - o[1], point[2] - o[2]
    fx, fy, fz = force[0], force[1], force[2]
    cx = R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz
    cy = R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz
    cz = R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz
    nx, ny, nz = 0.0, 0.0, 0.0
    reached = False
    if link < skin.shape.shape[0]:
        left, sx, sy, sz, nx, ny, nz = slide(
            skin.values,
            skin.start,
            skin.shape,
            skin.low,
            skin.cell,
            link,
            cx,
            cy,
            cz,
            R[0, 0] * fx + R[1, 0] * fy + R[2, 0] * fz,
            R[0, 1] * fx + R[1, 1] * fy + R[2, 1] * fz,
            R[0, 2] * fx + R[1, 2] * fy + R[2, 2] * fz,
            SLIDE_STEPS,
        )
        reached = abs(left) < REACHED
        if reached:
            cx, cy, cz = sx, sy, sz
    row[4], row[5], row[6] = cx, cy, cz
    for i in range(3):
        row[7 + i] = o[i] + R[i, 0] * cx + R[i, 1] * cy + R[i, 2] * cz
        row[10 + i] = R[i, 0] * nx + R[i, 1] * ny + R[i, 2] * nz if reached else normal[i]
        row[13 + i] = force[i]
        for j in range(3):
            row[16 + 3 * i + j] = covariance[i, j]
