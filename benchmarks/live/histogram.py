"""Histogram of latencies, printed as bars."""

from collections.abc import Iterator, Sequence
from typing import TypeAlias

import numpy as np

Histogram: TypeAlias = list[tuple[float, int]]
"""Lower edge of each bin [ms], and how many values are in it."""

EDGES = (0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0, 10.0, 20.0, 50.0)
"""Lower edges of the bins [ms]; the last one contains all longer times."""
WIDTH = 50
"""Length of the longest bar, in characters."""


def histogram(values: Sequence[float] | np.ndarray) -> Histogram:
    """How many of the values [ms], shape (N,), are in each bin."""
    counts, _ = np.histogram(values, (*EDGES, np.inf))
    return list(zip(EDGES, counts.tolist(), strict=True))


def bars(bins: Histogram) -> Iterator[str]:
    """One line for each bin."""
    most = max(count for _, count in bins)
    for (low, count), high in zip(bins, (*EDGES[1:], np.inf), strict=True):
        yield f"{low:6.2f} to {high:6.2f} ms {count:7d} {'#' * round(WIDTH * count / most)}"
