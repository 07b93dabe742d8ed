"""Answers that the localizer is expected to give for a push, where the place is open.

Where noise moves the answer by a centimetre and more, the surface is not flat on that scale: links end, have
edges and another side, and the answer is the densest place of many or jumps between several modes. A
covariance does not describe this. So the posterior of the surface's cells is integrated as the localizer
does (`contactsense.localization.surface_search`), with the linear evidence of
`contactsense.surface_map.cell_evidence`, for the readings of `contactsense.surface_map.noise_points`: the
best cell and its surroundings are the candidate, its place is the mode if the posterior is narrow and else
that of `contactsense.localization.mean_shift`, and the candidate with the highest evidence is the answer.
"""

from typing import NamedTuple

import numpy as np

from contactsense.localization.surface_candidate import MERGE_DISTANCE, MERGE_SIGMAS
from contactsense.localization.surface_evidence import MAX_SUBDIVIDED, SUBDIVIDE_WITHIN
from contactsense.surface_map.best_candidates import best_candidates
from contactsense.surface_map.cell_evidence import EXPECTED, CellEvidence, posterior, subset
from contactsense.surface_map.places import Places

_CUTOFF = 20.0
"""Cells whose log evidence for the mean reading is worse than the best by this much are left out: noise of
more than two standard deviations brings them to a tenth of a percent."""


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
    found = posterior(of, noisy)
    link, point = np.empty(len(noisy), dtype=np.int64), np.zeros((len(noisy), 3))
    best_candidates(
        np.ascontiguousarray(found.evidence.T),
        found.step,
        Places(*map(np.ascontiguousarray, of.cells)),
        of.variance,
        np.maximum(MERGE_DISTANCE, MERGE_SIGMAS * of.deviation),
        of.gain @ noisy.T - of.gain @ of.projection[:, EXPECTED, :, None],
        np.empty((4, len(of.variance))),
        link,
        point,
    )
    return Answers(link, point)
