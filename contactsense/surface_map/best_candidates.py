"""The best of a reading's candidates: a cell and its surroundings, at their mode or densest place."""

import math

import numpy as np

from contactsense.localization.mean_shift import mean_shift
from contactsense.localization.surface_candidate import NARROW_POSTERIOR_CELLS
from contactsense.robots.jit.kernel import kernel
from contactsense.surface_map.places import Places

_CANDIDATES = 3
"""The best of this many candidates is the answer."""


@kernel
def best_candidates(
    evidence: np.ndarray,
    step: np.ndarray,
    cells: Places,
    variance: np.ndarray,
    reach: np.ndarray,
    to_mode: np.ndarray,
    members: np.ndarray,
    best_link: np.ndarray,
    best_point: np.ndarray,
) -> None:
    """Find the answers to K readings of one push among C cells.

    Args:
        evidence: Of each reading and cell, shape (K, C); that of what belongs to a candidate becomes
            -infinity.
        step: As in `contactsense.surface_map.cell_evidence.Posterior`, shape (C, 2, K) [m].
        cells: The cells.
        variance: As in `contactsense.surface_map.cell_evidence.CellEvidence`, shape (C,) [m^2].
        reach: Distance within which cells belong to a candidate, shape (C,) [m].
        to_mode: Step from each cell to the most probable place near it, shape (C, 2, K) [m].
        members: Scratch, shape (4, C).
        best_link: Filled with the link of each answer, -1 without, shape (K,), int64.
        best_point: Filled with its place, shape (K, 3) [m].
    """
    link, point, tangents = cells.link, cells.point, cells.tangents
    for k in range(evidence.shape[0]):
        best, best_link[k] = -math.inf, -1
        for _ in range(_CANDIDATES):
            first, top = 0, -math.inf
            for c in range(len(link)):
                if evidence[k, c] > top:
                    first, top = c, evidence[k, c]
            # All that is left together is no better, or no push explains the reading.
            if top + math.log(len(link)) <= best:
                break
            x, y, z = point[first]
            u, v = to_mode[first, 0, k], to_mode[first, 1, k]
            x += tangents[first, 0, 0] * u + tangents[first, 0, 1] * v
            y += tangents[first, 1, 0] * u + tangents[first, 1, 1] * v
            z += tangents[first, 2, 0] * u + tangents[first, 2, 1] * v
            count, total, square, mx, my, mz = 0, 0.0, 0.0, 0.0, 0.0, 0.0
            for c in range(len(link)):
                px, py, pz = point[c]
                apart = (px - x) ** 2 + (py - y) ** 2 + (pz - z) ** 2
                if c != first and (link[c] != link[first] or apart >= reach[first] ** 2):
                    continue
                weight = math.exp(evidence[k, c] - top)
                total += weight
                mx, my, mz = mx + weight * px, my + weight * py, mz + weight * pz
                square += weight * (px * px + py * py + pz * pz + variance[c])
                a, b = step[c, 0, k], step[c, 1, k]
                members[0, count] = px + tangents[c, 0, 0] * a + tangents[c, 0, 1] * b
                members[1, count] = py + tangents[c, 1, 0] * a + tangents[c, 1, 1] * b
                members[2, count] = pz + tangents[c, 2, 0] * a + tangents[c, 2, 1] * b
                members[3, count] = weight
                count += 1
                evidence[k, c] = -math.inf
            if top + math.log(total) <= best:
                continue
            best, best_link[k] = top + math.log(total), link[first]
            mx, my, mz = mx / total, my / total, mz / total
            narrow = 2.0 * (NARROW_POSTERIOR_CELLS * cells.spread[first]) ** 2
            if square / total - (mx * mx + my * my + mz * mz) < narrow:
                best_point[k, 0], best_point[k, 1], best_point[k, 2] = x, y, z
            else:
                place = mean_shift(members[:, :count], (mx, my, mz))
                best_point[k, 0], best_point[k, 1], best_point[k, 2] = place
