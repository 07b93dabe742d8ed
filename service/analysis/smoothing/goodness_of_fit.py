"""Whether squared residuals are what noise leaves."""

import math

LARGEST_EXCESS = 6.0
"""Largest excess of the squared residuals over their expectation, in standard deviations of chi-square."""


def is_good_fit(square: float, freedom: float, unmodelled: float = 0.0) -> bool:
    """Whether noise leaves residuals of this size.

    Args:
        square: Sum of the squared residuals, in units of their variances.
        freedom: Degrees of freedom.
        unmodelled: What errors of the model may leave in addition, in the same units.
    """
    return square <= freedom + LARGEST_EXCESS * math.sqrt(2.0 * freedom) + unmodelled
