"""Robust weighted least squares with a prior.

The rows are residuals r and slopes A of many equations. With Huber's weights w and each equation's noise, the
step d minimizes

    sum_c  sum w (r + A d)^2 / (sigma_c^2 tau_c)  +  |d + x - x0|^2 / prior_std^2,

x0 being the scene's values. Model errors are slow, so that neighbouring rows are correlated: tau_c, the
residual's correlation time in rows, reduces the weight of the data relative to the prior accordingly.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from contactsense.calibration.fit.residual_autocovariance import (
    autocovariances,
    correlation_time,
    innovation_variance,
)
from contactsense.calibration.residuals.residual_jacobian import Rows

MAD_SCALE = 1.4826
"""Standard deviation of a Gaussian variable over its median absolute deviation."""
_HUBER = 2.5
"""Residuals beyond this many standard deviations are weighted down."""
_ITERATIONS = 6


@dataclass(frozen=True)
class RobustFit:
    """A step of the parameters, and what its covariance follows from. k parameters, C equations."""

    step: np.ndarray
    """Change of the parameters, shape (k,)."""
    information: np.ndarray
    """Information matrix of the data, without the prior, shape (k, k)."""
    sigma: np.ndarray
    """Robust standard deviation of each equation's residual after the step, shape (C,); NaN without rows."""
    tau: np.ndarray
    """Correlation time of each equation's residual, in rows, shape (C,)."""
    weights: list[np.ndarray]
    """Huber's weight of each row, shape (N,) each."""
    autocovariance: list[np.ndarray]
    """Of each equation's weighted residual after the step, for lags from 0 on, shape (L,) each."""
    cost: float
    """Twice the negative log likelihood of the residuals up to a constant: sum of N ln of the variance of
    their innovations, what the rows before do not predict (the Whittle likelihood)."""


def fit_robust(
    rows: list[Rows],
    prior: np.ndarray,
    offset: np.ndarray,
    free: np.ndarray,
    channels: int,
) -> RobustFit:
    """Solve for the free parameters; the others keep their values.

    Args:
        rows: Residuals and slopes of all equations and recordings.
        prior: Standard deviation of each parameter's prior, shape (k,).
        offset: The parameters' current values minus the centre of the prior, shape (k,).
        free: Which may change, shape (k,), bool.
        channels: Number of equations, C.
    """
    k = len(prior)
    sigma, tau = np.full(channels, np.nan), np.ones(channels)
    weights = [row.moving.astype(float) for row in rows]
    _scale([row.residual for row in rows], rows, sigma)
    step = np.zeros(k)
    for iteration in range(_ITERATIONS):
        H, g = _normal_equations(rows, weights, sigma, tau, k)
        precision = 1.0 / prior**2
        A = (H + np.diag(precision))[np.ix_(free, free)]
        _require_regular(A)
        step = np.zeros(k)
        step[free] = np.linalg.solve(A, -(g + precision * offset)[free])
        residuals = [row.residual + row.slope @ step[row.columns] for row in rows]
        _scale(residuals, rows, sigma)
        for i, row in enumerate(rows):
            if row.moving.any():
                ratio = _HUBER * sigma[row.channel] / np.maximum(np.abs(residuals[i]), 1e-300)
                weights[i] = row.moving * np.minimum(1.0, ratio)
        covariances = autocovariances(residuals, weights, rows, channels)
        if iteration < 2:
            tau = np.array([correlation_time(c) for c in covariances])
    H, _ = _normal_equations(rows, weights, sigma, tau, k)
    counts = [sum(row.moving.sum() for row in rows if row.channel == c) for c in range(channels)]
    cost = sum(n * np.log(innovation_variance(covariances[c])) for c, n in enumerate(counts) if n)
    return RobustFit(step, H, sigma, tau, weights, covariances, float(cost))


def _scale(residuals: list[np.ndarray], rows: list[Rows], sigma: np.ndarray) -> None:
    """Fill `sigma` with the robust standard deviation of each equation, from the median absolute residual."""
    for c in range(len(sigma)):
        parts = [np.abs(r[row.moving]) for r, row in zip(residuals, rows, strict=True) if row.channel == c]
        values = np.concatenate(parts) if parts else np.empty(0)
        sigma[c] = max(MAD_SCALE * np.median(values), 1e-9) if len(values) else np.nan


def _normal_equations(
    rows: list[Rows], weights: list[np.ndarray], sigma: np.ndarray, tau: np.ndarray, k: int
) -> tuple[np.ndarray, np.ndarray]:
    H, g = np.zeros((k, k)), np.zeros(k)
    for row, W in weighted_slopes(rows, weights, sigma, tau):
        H[np.ix_(row.columns, row.columns)] += W.T @ row.slope
        g[row.columns] += W.T @ row.residual
    return H, g


def weighted_slopes(
    rows: list[Rows], weights: list[np.ndarray], sigma: np.ndarray, tau: np.ndarray
) -> Iterator[tuple[Rows, np.ndarray]]:
    """The rows that count, each with its slopes times its weights over the variance."""
    for row, weight in zip(rows, weights, strict=True):
        if weight.any() and len(row.columns):
            yield row, row.slope * (weight / (sigma[row.channel] ** 2 * tau[row.channel]))[:, None]


def _require_regular(A: np.ndarray) -> None:
    """Raise a LinAlgError if a symmetric matrix is singular up to rounding, whatever the units of its rows:
    whether a factorization notices that depends on the order of its sums."""
    size = np.sqrt(np.diag(A))
    if len(size) and not (size > 0.0).all():
        raise np.linalg.LinAlgError("Singular matrix")
    if len(size) and np.linalg.eigvalsh(A / np.outer(size, size))[0] < len(size) * np.finfo(float).eps:
        raise np.linalg.LinAlgError("Singular matrix")
