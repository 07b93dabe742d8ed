"""The likelihood by which models of friction are compared."""

import numpy as np
import pytest
from scipy.signal import lfilter

from contactsense.calibration.fit.robust_least_squares import RobustFit, fit_robust
from contactsense.calibration.residuals.residual_jacobian import Rows


def _fit(residual: np.ndarray, unit: float) -> RobustFit:
    """Fit one parameter, a constant offset. `unit`: size of one unit of the residual."""
    n = len(residual)
    rows = Rows(
        channel=0,
        columns=np.array([0]),
        residual=residual / unit,
        slope=np.full((n, 1), 1.0 / unit),
        moving=np.ones(n, dtype=bool),
        dt=0.01,
    )
    return fit_robust([rows], np.array([10.0]), np.zeros(1), np.array([True]), channels=1)


def _correlated(ratio: float, n: int = 6000) -> np.ndarray:
    """Residuals of which each is `ratio` times the one before, and new noise of variance 1."""
    noise = np.random.default_rng(3).standard_normal(n)
    return np.asarray(lfilter([1.0], [1.0, -ratio], noise))


@pytest.mark.parametrize("ratio", [0.0, 0.5, 0.9])
def test_the_cost_is_that_of_what_the_residuals_before_do_not_predict(ratio: float) -> None:
    noise = 0.2 * _correlated(ratio)
    assert _fit(noise, 1.0).cost == pytest.approx(len(noise) * np.log(0.2**2), rel=0.03)


def test_which_of_two_models_is_the_likelier_does_not_depend_on_the_unit() -> None:
    """A model whose residuals are as large, but slower, explains the more."""
    slow, fast = 0.1 * _correlated(0.9), 0.23 * _correlated(0.0)
    assert np.std(slow) == pytest.approx(np.std(fast), rel=0.05)
    differences = [_fit(slow, unit).cost - _fit(fast, unit).cost for unit in (1e-3, 1.0, 1e3)]
    assert differences[0] < -1000.0
    assert differences == pytest.approx([differences[0]] * 3, rel=1e-6)
