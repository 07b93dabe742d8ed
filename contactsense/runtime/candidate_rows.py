"""Write candidates as rows of numbers, see `contactsense.runtime.result_rows`."""

from typing import NamedTuple

import numpy as np

from contactsense.robots.jit.kernel import inlined_kernel, kernel
from contactsense.robots.surface.signed_distance_grid import Grids, intersect_skin
from contactsense.robots.vectors import add, dot, rotate, rotate_back, subtract, vector
from contactsense.runtime.result_rows import (
    FIRST_COVARIANCE,
    FIRST_FORCE,
    FIRST_NORMAL,
    FIRST_POINT,
    FIRST_POINT_BASE,
    LINK,
    PRIMITIVE,
    PROBABILITY,
    TORSION,
)
from contactsense.runtime.state import State
from contactsense.scene_model.constants import Constants

SKIN_STEPS = 5
"""Newton steps from the primitive to the skin along the line of action."""
SKIN_TOLERANCE = 1e-4
"""Largest distance from the skin at which the point counts as on it [m]."""
MIN_REPORTED_PROBABILITY = 0.01
"""Candidates less probable than this are not reported."""


class CandidateRow(NamedTuple):
    """What is written of one contact; base frame."""

    primitive: int
    """Index of the primitive in the arm."""
    probability: float
    torsion: float
    """[Nm]"""
    point: np.ndarray
    """Shape (3,) [m]."""
    normal: np.ndarray
    """Outward unit normal, shape (3,)."""
    force: np.ndarray
    """Shape (3,) [N]."""
    covariance: np.ndarray
    """Of the point, shape (3, 3) [m^2]."""


@inlined_kernel
def write_candidates(constants: Constants, state: State, skin: Grids, count: int, rows: np.ndarray) -> int:
    """Write those of the first `count` candidates in `state` that are probable enough; returns how many.

    Where `skin` has a grid for the link, point and normal are those where the line of action enters the skin.
    Shifting a force along its line does not change its wrench, so that point explains the measurement
    equally well.
    """
    candidates = state.candidates
    written = 0
    for k in range(count):
        p = candidates.order[k]
        if candidates.probability[p] < MIN_REPORTED_PROBABILITY:
            break
        found = CandidateRow(
            candidates.primitive[p], candidates.probability[p], candidates.torsion[p], candidates.point[p],
            candidates.normal[p], candidates.force[p], candidates.covariance[p],
        )  # fmt: skip
        write_row(constants, state, skin, found, rows[k])
        written += 1
    return written


@kernel
def write_row(constants: Constants, state: State, skin: Grids, found: CandidateRow, row: np.ndarray) -> None:
    """Write one contact as a row; its point on the skin where a grid is available."""
    link = constants.surfaces.link[found.primitive]
    body = constants.sensors.depth[link]
    R, o = state.motion.rotation[body], vector(state.motion.origin[body])
    row[LINK], row[PRIMITIVE] = link, found.primitive
    row[PROBABILITY], row[TORSION] = found.probability, found.torsion
    c, n = rotate_back(R, subtract(vector(found.point), o)), vector(found.normal)
    if link < skin.shape.shape[0]:
        force = rotate_back(R, vector(found.force))
        distance, point, normal = intersect_skin(skin, link, c, force, SKIN_STEPS)
        # At a rib or an edge, the line may leave the link at the nearest skin: there the force would pull.
        if abs(distance) < SKIN_TOLERANCE and dot(force, normal) < 0.0:
            c, n = point, rotate(R, normal)
    base = add(o, rotate(R, c))
    for i in range(3):
        row[FIRST_POINT + i], row[FIRST_POINT_BASE + i] = c[i], base[i]
        row[FIRST_NORMAL + i], row[FIRST_FORCE + i] = n[i], found.force[i]
        for j in range(3):
            row[FIRST_COVARIANCE + 3 * i + j] = found.covariance[i, j]
