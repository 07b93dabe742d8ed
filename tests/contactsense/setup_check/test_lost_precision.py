"""The uncertainty of what a motion hardly tells, which rounding loses."""

import numpy as np
from scipy.linalg import lu_factor

from contactsense.setup_check.fit.solution import Solution


def spread(precision: np.ndarray, biases: dict[str, int], values: np.ndarray) -> np.ndarray:
    none = np.zeros(0)
    return Solution(0.0, 0.0, none, values, lu_factor(precision), none, biases).spread


def test_what_rounding_loses_is_as_uncertain_as_before_the_motion() -> None:
    """Of 1e18, 256 is the last digit: an arm at rest leaves such sums of biases. `check` wrote a warning of
    NumPy's, and had no uncertainty."""
    precision = np.eye(9)
    precision[:2, :2] = 1e18
    precision[1, 1] -= 256.0
    precision[8, 8] = 4.0
    assert (np.diag(np.linalg.inv(precision))[:2] < 0.0).all()
    np.testing.assert_allclose(spread(precision, {}, np.zeros(9)), [*np.ones(8), 0.5])
    # A bias of a sensor, whose distribution has wide tails.
    values = np.array([3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    wide = spread(precision, {"base_wrench": 0}, values)
    np.testing.assert_allclose(wide[:2], np.sqrt([5.0, 0.5]))
