"""Candidates as rows of numbers, the form in which the kernels return them."""

import numpy as np

from contactsense.robots.jit.kernel import inlined_kernel, kernel
from contactsense.robots.surface.signed_distance_grid import Grids, intersect_skin
from contactsense.runtime.constants import Constants
from contactsense.runtime.state import State

LINK, PRIMITIVE, PROBABILITY, TORSION = 0, 1, 2, 3
POINT, POINT_BASE, NORMAL, FORCE = slice(4, 7), slice(7, 10), slice(10, 13), slice(13, 16)
COVARIANCE = slice(16, 25)
NUMBERS, VECTORS = slice(0, 4), slice(4, 25)
WIDTH = 25
"""Columns of a row: link index; primitive index in the arm; probability; torsion [Nm]; point in the frame of
the body that carries the link [m]; point in the base frame [m]; normal; force [N]; covariance of the point
[m^2]. `NUMBERS` are the first four columns, `VECTORS` the seven groups of three that follow."""

SKIN_STEPS = 5
"""Newton steps from the primitive to the skin along the line of action."""
SKIN_TOLERANCE = 1e-4
"""Largest distance from the skin at which the point counts as on it [m]."""
MIN_PROBABILITY = 0.01
"""Candidates less probable than this are not reported."""


@inlined_kernel
def write_candidates(constants: Constants, state: State, skin: Grids, count: int, rows: np.ndarray) -> int:
    """Write those of the first `count` candidates in `state` that are probable enough; returns how many.

    Where `skin` has a grid for the link, point and normal are those where the line of action crosses the
    skin. Shifting a force along its line does not change its wrench, so that point explains the measurement
    equally well.
    """
    candidates = state.candidates
    written = 0
    for k in range(count):
        p = candidates.order[k]
        if candidates.probability[p] < MIN_PROBABILITY:
            break
        write_row(
            constants,
            state,
            skin,
            candidates.primitive[p],
            candidates.probability[p],
            candidates.torsion[p],
            candidates.point[p],
            candidates.normal[p],
            candidates.force[p],
            candidates.covariance[p],
            rows[k],
        )
        written += 1
    return written


@kernel
def write_row(constants, state, skin, primitive, probability, torsion, point, normal, force, covariance, row):  # type: ignore[no-untyped-def]
    """Write one contact, base frame, as a row; its point on the skin where a grid is available."""
    link = constants.surfaces.link[primitive]
    body = constants.sensors.depth[link]
    R, o = state.motion.rotation[body], state.motion.origin[body]
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
    on_skin = False
    if link < skin.shape.shape[0]:
        distance, sx, sy, sz, nx, ny, nz = intersect_skin(
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
            SKIN_STEPS,
        )
        on_skin = abs(distance) < SKIN_TOLERANCE
        if on_skin:
            cx, cy, cz = sx, sy, sz
    row[4], row[5], row[6] = cx, cy, cz
    for i in range(3):
        row[7 + i] = o[i] + R[i, 0] * cx + R[i, 1] * cy + R[i, 2] * cz
        row[10 + i] = R[i, 0] * nx + R[i, 1] * ny + R[i, 2] * nz if on_skin else normal[i]
        row[13 + i] = force[i]
        for j in range(3):
            row[16 + 3 * i + j] = covariance[i, j]
