"""Explanations as rows of numbers, the form in which they leave the compiled part."""

import numpy as np

from contactsense.arm import Arm
from contactsense.memory import Memory
from robots.compiled import kernel

LINK, PRIMITIVE, PROBABILITY, TORSION = 0, 1, 2, 3
POINT, POINT_BASE, NORMAL, FORCE = slice(4, 7), slice(7, 10), slice(10, 13), slice(13, 16)
COVARIANCE = slice(16, 25)
WIDTH = 25
"""Columns of a row: number of the link; number of the primitive among all; probability; torsion [Nm]; point
in the frame of the body that carries the link, point in the base frame [m]; normal; force [N]; covariance of
the point [m^2]."""

LEAST_PROBABILITY = 0.01
"""Explanations less probable than this are not listed, but for the best."""


@kernel
def report(arm: Arm, memory: Memory, count: int, rows: np.ndarray) -> int:
    """Write the first `count` explanations in `memory` that are probable enough; returns how many."""
    found = memory.found
    listed = 0
    for k in range(count):
        p = found.order[k]
        if k > 0 and found.probability[p] < LEAST_PROBABILITY:
            break
        row = rows[k]
        link = arm.surfaces.link[p]
        body = arm.sensors.depth[link]
        R, o = memory.motion.rotation[body], memory.motion.origin[body]
        row[0] = link
        row[1] = p
        row[2] = found.probability[p]
        row[3] = found.torsion[p]
        dx, dy, dz = found.point[p, 0] - o[0], found.point[p, 1] - o[1], found.point[p, 2] - o[2]
        for i in range(3):
            row[4 + i] = R[0, i] * dx + R[1, i] * dy + R[2, i] * dz
            row[7 + i] = found.point[p, i]
            row[10 + i] = found.normal[p, i]
            row[13 + i] = found.force[p, i]
            for j in range(3):
                row[16 + 3 * i + j] = found.covariance[p, i, j]
        listed += 1
    return listed
