"""Autocovariance of residuals: of model errors, which are slow, so that neighbouring rows are correlated."""

from collections.abc import Sequence

import numpy as np
from scipy.fft import next_fast_len
from scipy.linalg import solve_toeplitz

from contactsense.calibration.residuals.residual_jacobian import Rows

_LAG = 1.5
"""Residuals further apart than this are treated as independent [s]."""


def autocovariances(
    residuals: list[np.ndarray], weights: list[np.ndarray], rows: list[Rows], channels: int
) -> list[np.ndarray]:
    """Sample autocovariance of each equation's weighted residuals, for lags from 0 on, shape (L,) each; one
    value without rows."""
    found = []
    for c in range(channels):
        indices = [i for i, row in enumerate(rows) if row.channel == c and row.moving.any()]
        if not indices:
            found.append(np.zeros(1))
            continue
        shortest = min(len(residuals[i]) for i in indices)
        lags = 1 + max(1, min(round(_LAG / min(rows[i].dt for i in indices)), shortest // 4))
        weighted = [residuals[i] * weights[i] for i in indices]
        total = sum((correlation([e[:, None]], [e[:, None]], lags) for e in weighted), np.zeros(lags))
        found.append(total / sum(rows[i].moving.sum() for i in indices))
    return found


def correlation(first: Sequence[np.ndarray], second: Sequence[np.ndarray], lags: int) -> np.ndarray:
    """Sums of first[t] second[t + l] over rows, columns and the pairs of both lists, for l from 0 on, shape
    (lags,). Arrays of shape (N, k)."""
    n = next_fast_len(len(first[0]) + lags, real=True)
    spectrum = sum(
        np.einsum("fk,fk->f", np.conj(np.fft.rfft(a, n, axis=0)), np.fft.rfft(b, n, axis=0))
        for a, b in zip(first, second, strict=True)
    )
    return np.asarray(np.fft.irfft(spectrum, n)[:lags])


def taper(lags: int) -> np.ndarray:
    """E. Parzen's window, shape (lags,). The spectrum of an autocovariance times this is nowhere negative."""
    x = np.arange(lags) / lags
    return np.where(x <= 0.5, 1.0 - 6.0 * x**2 * (1.0 - x), 2.0 * (1.0 - x) ** 3)


def correlation_time(autocovariance: np.ndarray) -> float:
    """Sum of the autocorrelation over all lags, in rows; at least one."""
    tapered = taper(len(autocovariance)) * autocovariance
    if tapered[0] <= 0.0:
        return 1.0
    return float(max(1.0, (tapered[0] + 2.0 * tapered[1:].sum()) / tapered[0]))


def innovation_variance(autocovariance: np.ndarray) -> float:
    """Variance of the error of the best linear prediction from all lags."""
    least = 1e-18
    tapered = taper(len(autocovariance)) * autocovariance
    if len(tapered) < 2 or tapered[0] <= least:
        return float(max(tapered[0], least))
    prediction = solve_toeplitz(tapered[:-1], tapered[1:])
    return float(max(tapered[0] - tapered[1:] @ prediction, least))
