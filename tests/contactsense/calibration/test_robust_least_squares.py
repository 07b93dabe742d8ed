"""Robust weighted least squares on its hard cases."""

import numpy as np

from contactsense.calibration.residual_jacobian import Rows
from contactsense.calibration.robust_least_squares import fit_robust


def rows_of(chance: np.random.Generator, channel: int, columns: list[int], moving: int) -> Rows:
    """300 rows of an equation, of which the first `moving` count; the true step is 1, 2, 3, ..."""
    slope = chance.standard_normal((300, len(columns)))
    residual = 0.1 * chance.standard_normal(300) - slope @ (1.0 + np.array(columns))
    return Rows(channel, residual, np.array(columns), slope, np.arange(300) < moving, 0.01)


def test_an_equation_with_fewer_rows_than_parameters_says_nothing() -> None:
    """As of a joint that moves for a moment: a fit through its rows is exact, which is no information."""
    chance = np.random.default_rng(0)
    full, few = rows_of(chance, 0, [0, 1], 300), rows_of(chance, 1, [2, 3, 4], 1)
    prior, free = np.full(5, 10.0), np.ones(5, dtype=bool)
    found = fit_robust([full, few], prior, np.zeros(5), free, 2)
    np.testing.assert_allclose(found.step[:2], [1.0, 2.0], atol=0.05)
    np.testing.assert_array_equal(found.step[2:], 0.0)
    assert np.isnan(found.sigma[1])
    np.testing.assert_allclose(np.diag(found.covariance)[2:], 100.0)
    many = fit_robust([full, rows_of(chance, 1, [2, 3, 4], 300)], prior, np.zeros(5), free, 2)
    np.testing.assert_allclose(many.step, [1.0, 2.0, 3.0, 4.0, 5.0], atol=0.1)
