"""Whether stated probabilities are true: of what is said with probability p, p should be right."""

from typing import Any, NamedTuple

import numpy as np

BINS = 10
"""Bins of equal width that probabilities are sorted into."""
_TRIALS = 1000
"""Draws of right and wrong that the range of chance is taken from."""


class Bin(NamedTuple):
    """The statements whose probability lies in one bin."""

    low: float
    high: float
    samples: int
    stated: float
    """Mean of their probabilities."""
    right: float
    """Share of them that is right."""


class Reliability(NamedTuple):
    """How stated probabilities compare with what turned out right."""

    error: float
    """Expected calibration error: mean of |stated - right| over bins, weighted by their counts."""
    by_chance: float
    """The same, on average, for these very probabilities if they are true: what chance alone makes of it. It
    is above zero, as gaps of either sign count alike."""
    by_chance_95: float
    """What chance alone exceeds in one case of twenty: a larger error is not chance."""
    bins: tuple[Bin, ...]
    """Those that hold anything."""

    def as_json(self) -> dict[str, Any]:
        """Plain numbers."""
        return {
            "error": self.error,
            "by_chance": self.by_chance,
            "by_chance_95": self.by_chance_95,
            "bins": [entry._asdict() for entry in self.bins],
        }


def reliability(probability: np.ndarray, right: np.ndarray) -> Reliability:
    """Compare probabilities with outcomes.

    Args:
        probability: What was stated, from 0 to 1, shape (N,).
        right: Whether it turned out right, shape (N,), bool.
    """
    number = np.minimum((probability * BINS).astype(int), BINS - 1)
    bins = []
    for k in range(BINS):
        own = number == k
        if own.any():
            stated, share = float(probability[own].mean()), float(right[own].mean())
            bins.append(Bin(k / BINS, (k + 1) / BINS, int(own.sum()), stated, share))
    rng = np.random.default_rng(0)
    chance = [_error(number, probability, rng.random(len(right)) < probability) for _ in range(_TRIALS)]
    return Reliability(
        error=_error(number, probability, right),
        by_chance=float(np.mean(chance)),
        by_chance_95=float(np.quantile(chance, 0.95)),
        bins=tuple(bins),
    )


def _error(number: np.ndarray, probability: np.ndarray, right: np.ndarray) -> float:
    if len(number) == 0:
        return float("nan")
    gap = np.bincount(number, weights=probability - right, minlength=BINS)
    return float(np.abs(gap).sum() / len(number))
