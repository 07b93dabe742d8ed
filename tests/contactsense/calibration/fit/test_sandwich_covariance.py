"""The stated covariance of parameters is that of their errors, although the fit follows slow residuals."""

import numpy as np
import pytest
from scipy.signal import lfilter

from contactsense.calibration.fit.robust_least_squares import fit_robust
from contactsense.calibration.fit.sandwich_covariance import sandwich_covariance
from contactsense.calibration.residuals.residual_jacobian import Rows

ROWS, PARAMETERS, DRAWS, DT = 1200, 9, 150, 0.02


def _errors(rng: np.random.Generator, ratio: float) -> np.ndarray:
    """Each value is `ratio` times the one before, and new noise; variance 1, stationary from the start."""
    noise = rng.standard_normal(ROWS + 400) * np.sqrt(1.0 - ratio**2)
    return np.asarray(lfilter([1.0], [1.0, -ratio], noise))[400:]


def _slow_cosines() -> np.ndarray:
    """Slopes by an offset and slow cosines, shape (ROWS, PARAMETERS)."""
    t = (np.arange(ROWS) + 0.5) / ROWS
    return np.cos(np.pi * t[:, None] * np.arange(PARAMETERS))


def _fit(residuals: list[np.ndarray], free: np.ndarray, unit: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Step and covariance. One equation for each residual, all with the same parameters."""
    rows = [
        Rows(
            channel=channel,
            columns=np.arange(PARAMETERS),
            residual=residual / unit,
            slope=_slow_cosines() / unit,
            moving=np.ones(ROWS, dtype=bool),
            dt=DT,
        )
        for channel, residual in enumerate(residuals)
    ]
    prior = np.full(PARAMETERS, 100.0)
    found = fit_robust(rows, prior, np.zeros(PARAMETERS), free, len(rows))
    return found.step, sandwich_covariance(rows, found, prior, free)


@pytest.mark.parametrize("ratio", [0.0, 0.8, 0.95])
@pytest.mark.parametrize("equations", [1, 3])
def test_the_stated_variance_is_that_of_the_errors(ratio: float, equations: int) -> None:
    rng = np.random.default_rng(5)
    free = np.ones(PARAMETERS, dtype=bool)
    fits = [_fit([_errors(rng, ratio) for _ in range(equations)], free) for _ in range(DRAWS)]
    actual = np.mean([step**2 for step, _ in fits], axis=0)
    stated = np.mean([np.diag(covariance) for _, covariance in fits], axis=0)
    # The residuals' own autocovariance would state 0.43 to 0.88 of the variance.
    assert np.mean(stated / actual) == pytest.approx(1.0, abs=0.25)


def test_variances_do_not_depend_on_the_unit_and_are_positive() -> None:
    errors = [_errors(np.random.default_rng(7), 0.95)]
    free = np.ones(PARAMETERS, dtype=bool)
    covariances = [_fit(errors, free, unit)[1] for unit in (1e-3, 1.0, 1e3)]
    np.testing.assert_allclose(covariances[0], covariances[1], rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(covariances[2], covariances[1], rtol=1e-6, atol=1e-12)
    assert np.linalg.eigvalsh(covariances[1])[0] > 0.0


def test_parameters_that_keep_their_values_have_no_covariance() -> None:
    free = np.arange(PARAMETERS) < 4
    step, covariance = _fit([_errors(np.random.default_rng(9), 0.8)], free)
    assert not step[~free].any()
    assert not covariance[~free].any()
    assert not covariance[:, ~free].any()
    assert (np.diag(covariance)[free] > 0.0).all()
