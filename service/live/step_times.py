"""Histogram of the duration of the localizer's step."""

from bisect import bisect_left

BOUNDS = (20e-6, 50e-6, 100e-6, 200e-6, 500e-6, 1e-3, 2e-3, 5e-3, 10e-3, 100e-3)
"""Upper limits of the bins [s]; longer durations fall into one more bin."""


class StepTimes:
    """Number of steps by duration."""

    def __init__(self) -> None:
        self.counts = [0] * (len(BOUNDS) + 1)
        """Number of steps in each bin."""
        self.total = 0.0
        """Total duration of all steps [s]."""

    def add(self, seconds: float) -> None:
        """Count a step of this duration [s]."""
        self.counts[bisect_left(BOUNDS, seconds)] += 1
        self.total += seconds
