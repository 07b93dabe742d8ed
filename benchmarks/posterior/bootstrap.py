"""Bootstrap interval of the ratio of two methods' errors on the same contacts."""

from typing import NamedTuple

import numpy as np

_DRAWS = 2000


class Ratio(NamedTuple):
    """Quantile of one method's errors over that of another's."""

    found: float
    low: float
    high: float
    """Bounds of the 95 % bootstrap interval; both methods use the same resampled contacts."""

    def __str__(self) -> str:
        return f"{self.found:.2f} [{self.low:.2f}-{self.high:.2f}]"


def ratio(ours: np.ndarray, best: np.ndarray, quantile: float) -> Ratio:
    """Ratio of a quantile of the errors of two methods on the same contacts.

    Args:
        ours, best: Error on each contact, infinite if there is no estimate, shape (N,) [m].
        quantile: Between 0 and 1.
    """
    rng = np.random.default_rng(0)
    rows = rng.integers(len(ours), size=(_DRAWS, len(ours)))
    with np.errstate(invalid="ignore"):
        value = _quantile(ours, quantile) / _quantile(best, quantile)
        resampled = _quantile(ours[rows], quantile) / _quantile(best[rows], quantile)
    low, high = np.quantile(resampled, (0.025, 0.975), method="nearest")
    return Ratio(float(value), float(low), float(high))


def _quantile(errors: np.ndarray, quantile: float) -> np.ndarray:
    return np.asarray(np.quantile(errors, quantile, axis=-1, method="higher"))
