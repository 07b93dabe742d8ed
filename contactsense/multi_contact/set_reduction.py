"""Explanations by several contacts whose places do not differ significantly are one, as those by one contact
are: see `contactsense.localization.mixture_reduction`."""

import numpy as np

from contactsense.localization.mixture_reduction import (
    SIGNIFICANT_DISTANCE,
    mean,
    second_moments,
    squared_distance,
    write_moments,
)
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import subtract, vector
from contactsense.runtime.result_rows import COVARIANCE, LINK, POINT_BASE, PROBABILITY


def merge_overlapping_sets(rows: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Merge sets with the same number of contacts, on the same links and at places that do not differ.

    The squared distances of all places add up. So sets that differ in one place are merged as candidates are;
    and of two that arrive at once, whose places depend on each other, fewer.

    Args:
        rows: Contacts of all S sets, those of a set one after another, as in
            `contactsense.runtime.result_rows`, shape (N, WIDTH); the probability in each row is that of the
            whole set.
        counts: Number of contacts of each set, shape (S,), int64.

    Returns:
        Rows and counts of the sets that remain, as new arrays: the first one first, the others by falling
        probability.
    """
    merged, kept = rows.copy(), np.ones(len(counts), dtype=np.bool_)
    if not _merge(rows, counts, merged, kept):
        return merged, counts.copy()
    start = np.cumsum(counts) - counts
    order = np.flatnonzero(kept)
    falling = np.argsort(-merged[start[order[1:]], PROBABILITY], kind="stable")
    order[1:] = order[1:][falling]
    of_sets = np.concatenate([np.arange(start[s], start[s] + counts[s]) for s in order])
    return merged[of_sets], counts[order]


@kernel
def _merge(rows: np.ndarray, counts: np.ndarray, merged: np.ndarray, kept: np.ndarray) -> bool:
    """Add to those sets of `merged` that absorb others, and clear `kept` for the others; whether any did."""
    changed, first = False, 0
    for s in range(counts.shape[0]):
        other = first + counts[s]
        for t in range(s + 1, counts.shape[0]):
            if kept[s] and kept[t] and counts[s] == counts[t] and _is_same(rows, first, other, counts[s]):
                _absorb(rows, merged, first, other, counts[s])
                kept[t], changed = False, True
            other += counts[t]
        first += counts[s]
    return changed


@kernel
def _is_same(rows: np.ndarray, first: int, other: int, count: int) -> bool:
    """Whether two sets, which begin at these rows, do not differ significantly."""
    distance = 0.0
    for i in range(count):
        a, b = rows[first + i], rows[other + i]
        own = second_moments(a[COVARIANCE].reshape(3, 3), (0.0, 0.0, 0.0))
        offset = subtract(vector(b[POINT_BASE]), vector(a[POINT_BASE]))
        if a[LINK] != b[LINK]:
            return False
        distance += squared_distance(own, b[COVARIANCE].reshape(3, 3), offset)
    return distance < SIGNIFICANT_DISTANCE


@kernel
def _absorb(rows: np.ndarray, merged: np.ndarray, first: int, other: int, count: int) -> None:
    """Add the probability of one set to another one, and its second moments."""
    for i in range(count):
        a, b = merged[first + i], rows[other + i]
        a[PROBABILITY] += b[PROBABILITY]
        C = a[COVARIANCE].reshape(3, 3)
        offset = subtract(vector(b[POINT_BASE]), vector(a[POINT_BASE]))
        moments = mean(
            second_moments(C, (0.0, 0.0, 0.0)),
            second_moments(b[COVARIANCE].reshape(3, 3), offset),
            b[PROBABILITY] / a[PROBABILITY],
        )
        write_moments(moments, C)
