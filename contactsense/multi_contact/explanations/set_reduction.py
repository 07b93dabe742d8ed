"""Where earlier contacts are known, explanations that overlap with the answer are part of it, as are the
candidates of one contact: see `contactsense.localization.candidates.mixture_reduction`."""

import numpy as np

from contactsense.localization.candidates.mixture_reduction import (
    SIGNIFICANT_DISTANCE,
    mean,
    second_moments,
    squared_distance,
    write_moments,
)
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import subtract, vector
from contactsense.runtime.result_rows import COVARIANCE, LINK, POINT_BASE, PROBABILITY


def merge_with_answer(rows: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Merge the sets that have as many contacts as the first one, on the same links and at places that do not
    differ, with the first one. The squared distances of all places add up.

    Args:
        rows: Contacts of all S sets, those of a set one after another, as in
            `contactsense.runtime.result_rows`, shape (N, WIDTH); the probability in each row is that of the
            whole set.
        counts: Number of contacts of each set, shape (S,), int64.

    Returns:
        Rows and counts of the sets that remain, as new arrays.
    """
    merged, kept = rows.copy(), np.ones(len(counts), dtype=np.bool_)
    _merge(rows, counts, merged, kept)
    return merged[np.repeat(kept, counts)], counts[kept]


@kernel
def _merge(rows: np.ndarray, counts: np.ndarray, merged: np.ndarray, kept: np.ndarray) -> None:
    """Add sets to the first one of `merged`, and clear `kept` for them."""
    other = 0
    for t in range(counts.shape[0]):
        if t > 0 and counts[t] == counts[0] and _is_same(rows, other, counts[t]):
            _absorb(rows, merged, other, counts[t])
            kept[t] = False
        other += counts[t]


@kernel
def _is_same(rows: np.ndarray, other: int, count: int) -> bool:
    """Whether the set that begins at row `other` does not differ significantly from the first one."""
    distance = 0.0
    for i in range(count):
        a, b = rows[i], rows[other + i]
        if a[LINK] != b[LINK]:
            return False
        own = second_moments(a[COVARIANCE].reshape(3, 3), (0.0, 0.0, 0.0))
        offset = subtract(vector(b[POINT_BASE]), vector(a[POINT_BASE]))
        distance += squared_distance(own, b[COVARIANCE].reshape(3, 3), offset)
    return distance < SIGNIFICANT_DISTANCE


@kernel
def _absorb(rows: np.ndarray, merged: np.ndarray, other: int, count: int) -> None:
    """Add the probability of a set to the first one, and its second moments."""
    for i in range(count):
        a, b = merged[i], rows[other + i]
        a[PROBABILITY] += b[PROBABILITY]
        C = a[COVARIANCE].reshape(3, 3)
        offset = subtract(vector(b[POINT_BASE]), vector(a[POINT_BASE]))
        moments = mean(
            second_moments(C, (0.0, 0.0, 0.0)),
            second_moments(b[COVARIANCE].reshape(3, 3), offset),
            b[PROBABILITY] / a[PROBABILITY],
        )
        write_moments(moments, C)
