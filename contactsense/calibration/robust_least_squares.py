"""Robust weighted least squares with a prior, and a covariance that is valid for correlated residuals.

The rows are residuals r and slopes A of many equations. With Huber's weights w and each equation's noise, the
step d minimizes

    sum_c  sum w (r + A d)^2 / (sigma_c^2 tau_c)  +  |d + x - x0|^2 / prior_std^2,

x0 being the scene's values. Model errors are slow, so that neighbouring rows are correlated: tau_c, the
residual's correlation time in rows, reduces the weight of the data relative to the prior accordingly. The
covariance is the sandwich estimator H^-1 (sum A^T G A / (sigma^2 tau)^2 + prior) H^-1 with the tapered
autocovariance G of the residuals (W. K. Newey, K. D. West, "A simple, positive semi-definite,
heteroskedasticity and autocorrelation consistent covariance matrix", Econometrica 1987; E. Parzen's taper).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.signal import fftconvolve

from contactsense.calibration.residual_jacobian import Rows

MAD_SCALE = 1.4826
"""Standard deviation of a Gaussian variable over its median absolute deviation."""
_HUBER = 2.5
"""Residuals beyond this many standard deviations are weighted down."""
_ITERATIONS = 6
_LAG = 1.5
"""Residuals further apart than this are treated as independent [s]."""


@dataclass(frozen=True)
class RobustFit:
    """A step of the parameters and its uncertainty. k parameters, C equations."""

    step: np.ndarray
    """Change of the parameters, shape (k,)."""
    covariance: np.ndarray
    """Of the parameters, shape (k, k)."""
    information: np.ndarray
    """Information matrix of the data, without the prior, shape (k, k)."""
    sigma: np.ndarray
    """Robust standard deviation of each equation's residual after the step, shape (C,); NaN without rows."""
    cost: float
    """Twice the negative log likelihood of the residuals up to a constant: sum of N ln of the variance of
    their innovations, what the rows before do not predict (the Whittle likelihood)."""


def fit_robust(
    rows: list[Rows],
    prior: np.ndarray,
    offset: np.ndarray,
    free: np.ndarray,
    channels: int,
    unexcited: np.ndarray | None = None,
) -> RobustFit:
    """Solve for the free parameters; the others keep their values.

    Args:
        rows: Residuals and slopes of all equations and recordings.
        prior: Standard deviation of each parameter's prior, shape (k,).
        offset: The parameters' current values minus the centre of the prior, shape (k,).
        free: Which may change, shape (k,), bool.
        channels: Number of equations, C.
        unexcited: Which of the others are known by their prior only, shape (k,), bool: their uncertainty is
            added to the covariance of the free ones (S. F. Schmidt's consider parameters).
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
        covariances = _autocovariances(residuals, weights, rows, channels)
        if iteration < 2:
            tau = np.array([_correlation_time(c) for c in covariances])
    H, _ = _normal_equations(rows, weights, sigma, tau, k)
    counts = [sum(row.moving.sum() for row in rows if row.channel == c) for c in range(channels)]
    bread = np.zeros((k, k))
    bread[np.ix_(free, free)] = np.linalg.inv((H + np.diag(1.0 / prior**2))[np.ix_(free, free)])
    # Number of parameters fitted by each equation: trace of its part of the hat matrix.
    degrees_of_freedom = np.zeros(channels)
    for row, W in _weighted(rows, weights, sigma, tau):
        part = (W.T @ row.slope) * bread[np.ix_(row.columns, row.columns)]
        degrees_of_freedom[row.channel] += np.sum(part)
    meat = np.diag(1.0 / prior**2)
    for row, W in _weighted(rows, weights, sigma, tau):
        c = row.channel
        # The fit uses some of the residuals' degrees of freedom.
        autocovariance = covariances[c] / max(1.0 - degrees_of_freedom[c] * tau[c] / counts[c], 0.2)
        filtered = fftconvolve(
            W, np.concatenate((autocovariance[:0:-1], autocovariance))[:, None], mode="same", axes=0
        )
        meat[np.ix_(row.columns, row.columns)] += W.T @ filtered
    covariance = bread @ (0.5 * (meat + meat.T)) @ bread
    if unexcited is not None and unexcited.any():
        sensitivity = bread @ H[:, unexcited] * prior[unexcited]
        covariance += sensitivity @ sensitivity.T
    cost = sum(n * np.log(_innovation_variance(covariances[c])) for c, n in enumerate(counts) if n)
    return RobustFit(step, covariance, H, sigma, float(cost))


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
    for row, W in _weighted(rows, weights, sigma, tau):
        H[np.ix_(row.columns, row.columns)] += W.T @ row.slope
        g[row.columns] += W.T @ row.residual
    return H, g


def _weighted(
    rows: list[Rows], weights: list[np.ndarray], sigma: np.ndarray, tau: np.ndarray
) -> Iterator[tuple[Rows, np.ndarray]]:
    """The rows that count, each with its slopes times its weights over the variance."""
    for row, weight in zip(rows, weights, strict=True):
        if weight.any() and len(row.columns):
            yield row, row.slope * (weight / (sigma[row.channel] ** 2 * tau[row.channel]))[:, None]


def _autocovariances(
    residuals: list[np.ndarray], weights: list[np.ndarray], rows: list[Rows], channels: int
) -> list[np.ndarray]:
    """Autocovariance of each equation's weighted residuals, tapered, lags from 0 on."""
    found = []
    for c in range(channels):
        indices = [i for i, row in enumerate(rows) if row.channel == c and row.moving.any()]
        if not indices:
            found.append(np.zeros(1))
            continue
        lags = max(1, min(round(_LAG / rows[indices[0]].dt), min(len(residuals[i]) for i in indices) // 4))
        total, count = np.zeros(lags + 1), 0.0
        for i in indices:
            e = residuals[i] * weights[i]
            total += np.array([e[: len(e) - lag] @ e[lag:] for lag in range(lags + 1)])
            count += rows[i].moving.sum()
        x = np.arange(lags + 1) / (lags + 1)
        taper = np.where(x <= 0.5, 1.0 - 6.0 * x**2 * (1.0 - x), 2.0 * (1.0 - x) ** 3)
        found.append(taper * total / count)
    return found


def _correlation_time(covariance: np.ndarray) -> float:
    """Sum of the autocorrelation over all lags, in rows; at least one."""
    if covariance[0] <= 0.0:
        return 1.0
    return float(max(1.0, (covariance[0] + 2.0 * covariance[1:].sum()) / covariance[0]))


def _innovation_variance(covariance: np.ndarray) -> float:
    """Variance of the error of the best linear prediction from all lags, of an autocovariance."""
    least = 1e-18
    if len(covariance) < 2 or covariance[0] <= least:
        return float(max(covariance[0], least))
    prediction = solve_toeplitz(covariance[:-1], covariance[1:])
    return float(max(covariance[0] - covariance[1:] @ prediction, least))


def _require_regular(A: np.ndarray) -> None:
    """Raise a LinAlgError if a symmetric matrix is singular up to rounding, whatever the units of its rows:
    whether a factorization notices that depends on the order of its sums."""
    size = np.sqrt(np.diag(A))
    if len(size) and not (size > 0.0).all():
        raise np.linalg.LinAlgError("Singular matrix")
    if len(size) and np.linalg.eigvalsh(A / np.outer(size, size))[0] < len(size) * np.finfo(float).eps:
        raise np.linalg.LinAlgError("Singular matrix")
