"""Answers that the localizer is expected to give for a push, where the place is open.

Where noise moves the answer by a centimetre and more, the surface is not flat on that scale: links end, have
edges and another side, and the answer is a mean over the surface or jumps between several modes. A
covariance does not describe this. So the posterior of the surface's cells is integrated as the localizer
does (`contactsense.localization.surface_search`), with the linear evidence of
`contactsense.surface_map.cell_evidence`, for the readings of `contactsense.surface_map.noise_points`: the
best cell and its surroundings are the candidate, its place is the mode if the posterior is narrow and else
the mean, and the candidate with the highest evidence is the answer.
"""

from typing import NamedTuple

import numpy as np

from contactsense.localization.surface_evidence import MAX_SUBDIVIDED, SUBDIVIDE_WITHIN
from contactsense.localization.surface_search import MERGE_DISTANCE, MERGE_SIGMAS, NARROW_POSTERIOR_CELLS
from contactsense.surface_map.cell_evidence import EXPECTED, CellEvidence, posterior, subset

_CUTOFF = 20.0
"""Cells whose log evidence for the mean reading is worse than the best by this much are left out: noise of
more than two standard deviations brings them to a tenth of a percent."""
_CANDIDATES = 3
"""The best of this many candidates is the answer."""


class Answers(NamedTuple):
    """Answers to the K readings of one push."""

    link: np.ndarray
    """Link that each answer names, shape (K,), int64; -1 if no push explains the reading."""
    point: np.ndarray
    """Place of each answer, not yet moved to the surface, shape (K, 3) [m]."""


def expected_answers(
    coarse: CellEvidence, fine: CellEvidence, mean: np.ndarray, noisy: np.ndarray
) -> Answers:
    """Answers for the readings of one push.

    Args:
        coarse, fine: The surface's cells and subcells.
        mean: The mean reading, in units of the noise, shape (rows,).
        noisy: Readings with noise, shape (K, rows).
    """
    of, evidence = coarse, posterior(coarse, mean[None]).evidence[:, 0]
    if np.count_nonzero(evidence > evidence.max() - SUBDIVIDE_WITHIN) <= MAX_SUBDIVIDED:
        of, evidence = fine, posterior(fine, mean[None]).evidence[:, 0]
    return _answers(subset(of, evidence > evidence.max() - _CUTOFF), noisy)


def _answers(of: CellEvidence, noisy: np.ndarray) -> Answers:
    """Best candidates among the cells."""
    cells, found = of.cells, posterior(of, noisy)
    reading = np.arange(len(noisy))
    moments = np.column_stack((cells.point, (cells.point**2).sum(axis=1) + of.variance))
    tangents = cells.tangents.transpose(1, 0, 2).reshape(3, -1)
    reach = np.maximum(MERGE_DISTANCE, MERGE_SIGMAS * of.deviation)
    best_link, best_point = np.full(len(noisy), -1), np.zeros((len(noisy), 3))
    best_evidence = np.full(len(noisy), -np.inf)
    left = found.evidence
    for _ in range(_CANDIDATES):
        first = left.argmax(axis=0)
        top = left[first, reading]
        step = np.einsum("kir,kr->ki", of.gain[first], noisy - of.projection[first, EXPECTED])
        mode = cells.point[first] + np.einsum("kxi,ki->kx", cells.tangents[first], step)
        apart = ((cells.point[:, None] - mode) ** 2).sum(axis=2)
        near = (cells.link[:, None] == cells.link[first]) & (apart < reach[first] ** 2)
        near[first, reading] = True
        weight = np.where(near, np.exp(left - np.where(np.isfinite(top), top, 0.0)), 0.0)
        total = weight.sum(axis=0)
        with np.errstate(divide="ignore"):
            evidence = top + np.log(total)
        weight /= np.where(total > 0.0, total, 1.0)
        centre = weight.T @ moments
        spread = centre[:, 3] - (centre[:, :3] ** 2).sum(axis=1)
        mean = centre[:, :3] + (tangents @ (weight[:, None] * found.step).reshape(-1, len(noisy))).T
        narrow = spread < 2.0 * (NARROW_POSTERIOR_CELLS * cells.spread[first]) ** 2
        point = np.where(narrow[:, None], mode, mean)
        better = evidence > best_evidence
        best_link[better], best_point[better] = cells.link[first][better], point[better]
        best_evidence[better] = evidence[better]
        left = np.where(near, -np.inf, left)
        if not (left.max(axis=0) > best_evidence - np.log(len(left))).any():
            break
    return Answers(best_link, best_point)
