"""Smallest force that is detected, from the share of touches of random forces that are."""

import math
from typing import NamedTuple

from scipy.stats import binomtest


class ForceThreshold(NamedTuple):
    """Geometric mean of the smallest detected force [N]; NaN without touches."""

    mean: float
    low: float
    high: float
    """Its 95 % interval, by chance in the number of detected touches."""


def force_threshold(detected: int, touches: int, least: float, largest: float) -> ForceThreshold:
    """The estimate of Spearman and Kaerber (D. J. Finney, "Statistical method in biological assay", 1978).

    Each place and direction has a smallest force that is detected. If forces are drawn log-uniformly, the
    share that is not detected is where in their range its logarithm lies on average. Where a force outside of
    the range would be needed, the end of the range counts.

    Args:
        detected: Number of touches that were detected.
        touches: Number of all touches.
        least: Smallest force that was drawn [N].
        largest: Largest one [N].
    """
    if touches == 0:
        return ForceThreshold(*(math.nan,) * 3)
    interval = binomtest(detected, touches).proportion_ci(method="wilson")
    shares = (detected / touches, interval.high, interval.low)
    return ForceThreshold(*(float(largest * (least / largest) ** share) for share in shares))
