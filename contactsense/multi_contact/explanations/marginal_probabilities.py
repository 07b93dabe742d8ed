"""The probability of each contact: the sum over all sets that contain it."""

import numpy as np

from contactsense.robots.jit.kernel import kernel
from contactsense.runtime.result_rows import LINK, POINT_BASE, PROBABILITY

SAME_POINT_DISTANCE = 0.02
"""Contacts of two sets on one link within this distance are the same [m]."""


@kernel
def state_marginal_probabilities(
    rows: np.ndarray, counts: np.ndarray, probability: np.ndarray, link_probability: np.ndarray
) -> None:
    """Write into each row the sum of the probabilities of all sets that contain its contact.

    Args:
        rows: Contacts of all S sets, those of a set one after another, as in
            `contactsense.runtime.result_rows`, shape (N, WIDTH); with the probabilities of the sets.
        counts: Number of contacts of each set, at least 1, shape (S,).
        probability: Filled: probability of each set, shape (S,).
        link_probability: Probability that each link is touched, shape (links,); those of the sets are added.
    """
    row = 0
    for s in range(counts.shape[0]):
        probability[s] = rows[row, PROBABILITY]
        for i in range(row, row + counts[s]):
            counted = False
            for k in range(row, i):
                counted = counted or rows[k, LINK] == rows[i, LINK]
            if not counted:
                link_probability[int(rows[i, LINK])] += probability[s]
        row += counts[s]
    for i in range(rows.shape[0]):
        rows[i, PROBABILITY] = _marginal_probability(rows, counts, probability, i)


@kernel
def _marginal_probability(rows: np.ndarray, counts: np.ndarray, probability: np.ndarray, i: int) -> float:
    """Sum of the probabilities of all sets that contain the contact of row i."""
    point, marginal, row = rows[i, POINT_BASE], 0.0, 0
    for s in range(counts.shape[0]):
        for k in range(row, row + counts[s]):
            other = rows[k, POINT_BASE]
            x, y, z = other[0] - point[0], other[1] - point[1], other[2] - point[2]
            near = x * x + y * y + z * z < SAME_POINT_DISTANCE * SAME_POINT_DISTANCE
            if near and rows[k, LINK] == rows[i, LINK]:
                marginal += probability[s]
                break
        row += counts[s]
    return float(marginal)
