"""Covariance of parameters that were fitted to correlated residuals.

It is the sandwich estimator B (sum W^T G W + prior) B with the bread B = H^-1, the weighted slopes W and the
autocovariance G of the errors (W. K. Newey, K. D. West, "A simple, positive semi-definite, heteroskedasticity
and autocorrelation consistent covariance matrix", Econometrica 1987).

The fit follows the slow part of the errors, so that the residuals show too little of it. With the hat matrix
P = A B W^T, the residuals (I - P) e of errors e have the covariance

    (I - P) G (I - P)^T = G - P G - G P^T + P G P^T.

The means of its diagonals are the expected autocovariance of the residuals. The errors' spectrum is that of
the residuals times the ratio of the errors' spectrum to the expected one, found by iteration. A ratio, unlike
a difference, never makes a spectrum negative.

A window of lags smooths a spectrum, so that the peak of slow errors becomes too low. Therefore the window is
applied to what a first-order autoregression leaves (D. W. K. Andrews, J. C. Monahan, "An improved
heteroskedasticity and autocorrelation consistent covariance matrix estimator", Econometrica 1992).
"""

import numpy as np
from scipy.fft import dct, idct
from scipy.signal import fftconvolve

from contactsense.calibration.fit.residual_autocovariance import correlation, taper
from contactsense.calibration.fit.robust_least_squares import RobustFit, weighted_slopes
from contactsense.calibration.residuals.residual_jacobian import Rows

_ITERATIONS = 3
_MAX_AUTOREGRESSION = 0.97
_LENGTH = 8
"""Lags of the errors' autocovariance over those of the residuals': an autoregression decays slowly."""
_MAX_RATIO = 5.0
"""Where the fit takes away more of the errors' spectrum than all but this part, the residuals cannot tell how
much it was."""


def sandwich_covariance(
    rows: list[Rows],
    fit: RobustFit,
    prior: np.ndarray,
    free: np.ndarray,
    unexcited: np.ndarray | None = None,
) -> np.ndarray:
    """Covariance of the parameters of a fit, shape (k, k); zero for those that keep their values.

    Args:
        rows: Residuals and slopes that were fitted.
        fit: The fit.
        prior: Standard deviation of each parameter's prior, shape (k,).
        free: Which parameters were fitted, shape (k,), bool.
        unexcited: Which of the others are known by their prior only, shape (k,), bool: their uncertainty is
            added to the covariance of the free ones (S. F. Schmidt's consider parameters).
    """
    precision = np.diag(prior**-2.0)
    bread = np.zeros((len(prior), len(prior)))
    bread[np.ix_(free, free)] = np.linalg.inv((fit.information + precision)[np.ix_(free, free)])
    coefficients = [_autoregression(own) for own in fit.autocovariance]
    of_residuals = [_spectrum(own, a) for own, a in zip(fit.autocovariance, coefficients, strict=True)]
    of_errors = of_residuals
    for _ in range(_ITERATIONS):
        autocovariances = [idct(spectrum, type=1) for spectrum in of_errors]
        expected = _expected_autocovariances(rows, fit, bread, autocovariances)
        of_expected = [_spectrum(own, a) for own, a in zip(expected, coefficients, strict=True)]
        of_errors = [
            own * np.divide(true, left, where=true < _MAX_RATIO * left, out=np.full(len(true), _MAX_RATIO))
            for own, true, left in zip(of_residuals, of_errors, of_expected, strict=True)
        ]
    autocovariances = [idct(spectrum, type=1) for spectrum in of_errors]
    meat = _score_covariance(rows, fit, autocovariances) + precision
    covariance: np.ndarray = bread @ meat @ bread
    if unexcited is not None and unexcited.any():
        sensitivity = bread @ fit.information[:, unexcited] * prior[unexcited]
        covariance += sensitivity @ sensitivity.T
    return covariance


def _score_covariance(rows: list[Rows], fit: RobustFit, errors: list[np.ndarray]) -> np.ndarray:
    """Covariance of the gradient of the residuals' cost, sum W^T G W, shape (k, k)."""
    k = len(fit.step)
    found = np.zeros((k, k))
    for row, W in weighted_slopes(rows, fit.weights, fit.sigma, fit.tau):
        found[np.ix_(row.columns, row.columns)] += W.T @ _filtered(W, errors[row.channel])
    return 0.5 * (found + found.T)


def _filtered(W: np.ndarray, autocovariance: np.ndarray) -> np.ndarray:
    """G W, shape (N, k)."""
    both_sides = np.concatenate((autocovariance[:0:-1], autocovariance))
    return np.asarray(fftconvolve(W, both_sides[:, None], mode="same", axes=0))


def _expected_autocovariances(
    rows: list[Rows], fit: RobustFit, bread: np.ndarray, errors: list[np.ndarray]
) -> list[np.ndarray]:
    """Expected autocovariance of the residuals that errors with these autocovariances leave."""
    followed = bread @ _score_covariance(rows, fit, errors) @ bread
    found = [np.zeros(len(own)) for own in fit.autocovariance]
    count = np.zeros(len(errors))
    for row in rows:
        moving = row.moving.astype(float)[:, None]
        lags = len(found[row.channel])
        found[row.channel] += errors[row.channel][:lags] * correlation([moving], [moving], lags)
        count[row.channel] += row.moving.sum()
    for row, W in weighted_slopes(rows, fit.weights, fit.sigma, fit.tau):
        own, moving = np.ix_(row.columns, row.columns), row.moving[:, None]
        A, F = row.slope * moving, _filtered(W, errors[row.channel]) * moving
        AB = A @ bread[own]
        # The pairs are P G, its transpose and P G P^T.
        lags = len(found[row.channel])
        found[row.channel] += correlation((-AB, -F, A @ followed[own]), (F, AB, A), lags)
    return [sums / max(n, 1.0) for sums, n in zip(found, count, strict=True)]


def _autoregression(autocovariance: np.ndarray) -> float:
    """Coefficient of the first-order autoregression with this autocovariance."""
    if len(autocovariance) < 2 or autocovariance[0] <= 0.0:
        return 0.0
    return float(np.clip(autocovariance[1] / autocovariance[0], 0.0, _MAX_AUTOREGRESSION))


def _spectrum(autocovariance: np.ndarray, coefficient: float) -> np.ndarray:
    """Spectrum of a sample autocovariance, shape (F,), from zero to half the rate of the rows."""
    lags = len(autocovariance) - 1
    if lags < 1:
        return np.full(2, autocovariance[0])
    neighbours = autocovariance[1:] + np.concatenate((autocovariance[1:2], autocovariance[: lags - 1]))
    innovations = (1.0 + coefficient**2) * autocovariance[:lags] - coefficient * neighbours
    count = _LENGTH * lags
    frequency = np.pi * np.arange(count) / (count - 1)
    gain = 1.0 + coefficient**2 - 2.0 * coefficient * np.cos(frequency)
    return np.asarray(dct(taper(lags) * innovations, type=1, n=count) / gain)
