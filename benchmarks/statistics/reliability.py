"""Reliability of stated probabilities: of the statements with probability p, the fraction p should be
correct."""

from typing import Any, NamedTuple

import numpy as np

BINS = 10
"""Number of bins of equal width."""
_LEAST = 1e-4
"""A stated probability counts as at least this far from 0 and 1 in the log score, so that it is finite."""
_TRIALS = 1000
"""Number of simulated random outcomes that give the range due to chance."""


class Bin(NamedTuple):
    """The statements whose probability lies in one bin."""

    low: float
    high: float
    samples: int
    stated: float
    """Mean of their probabilities."""
    right: float
    """Fraction of them that is correct."""


class Reliability(NamedTuple):
    """Stated probabilities compared with outcomes."""

    error: float
    """Expected calibration error: mean of |stated - right| over bins, weighted by their counts."""
    by_chance: float
    """Its mean if what was stated is true. It is above zero, as gaps of either sign count."""
    by_chance_95: float
    """Its 95 % quantile if what was stated is true: a larger error is not chance."""
    log_score: float
    """Mean log of the probability that was stated of what came true; zero is perfect."""
    bins: tuple[Bin, ...]
    """The bins that are not empty."""

    def as_json(self) -> dict[str, Any]:
        """Plain numbers."""
        return {
            "error": self.error,
            "by_chance": self.by_chance,
            "by_chance_95": self.by_chance_95,
            "log_score": self.log_score,
            "bins": [entry._asdict() for entry in self.bins],
        }


def reliability(
    probability: np.ndarray, right: np.ndarray, expected: np.ndarray | None = None
) -> Reliability:
    """Compare probabilities with outcomes.

    Args:
        probability: Stated probability, from 0 to 1, shape (N,).
        right: Whether it was correct, shape (N,), bool.
        expected: Probability of being judged correct if what was stated is true, shape (N,), where the judge
            errs; default: `probability`.
    """
    expected = probability if expected is None else expected
    number = np.minimum((probability * BINS).astype(int), BINS - 1)
    bins = []
    for k in range(BINS):
        inside = number == k
        if inside.any():
            stated, share = float(probability[inside].mean()), float(right[inside].mean())
            bins.append(Bin(k / BINS, (k + 1) / BINS, int(inside.sum()), stated, share))
    rng = np.random.default_rng(0)
    chance = [_error(number, probability, rng.random(len(right)) < expected) for _ in range(_TRIALS)]
    return Reliability(
        error=_error(number, probability, right),
        by_chance=float(np.mean(chance)),
        by_chance_95=float(np.quantile(chance, 0.95)),
        log_score=_log_score(probability, right),
        bins=tuple(bins),
    )


def _log_score(probability: np.ndarray, right: np.ndarray) -> float:
    stated = np.clip(np.where(right, probability, 1.0 - probability), _LEAST, 1.0 - _LEAST)
    return float(np.log(stated).mean()) if len(stated) else float("nan")


def _error(number: np.ndarray, probability: np.ndarray, right: np.ndarray) -> float:
    if len(number) == 0:
        return float("nan")
    gap = np.bincount(number, weights=probability - right, minlength=BINS)
    return float(np.abs(gap).sum() / len(number))
