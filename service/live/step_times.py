"""How long the localizer's step takes: counts by length, as a histogram wants them."""

from bisect import bisect_left

BOUNDS = (20e-6, 50e-6, 100e-6, 200e-6, 500e-6, 1e-3, 2e-3, 5e-3, 10e-3, 100e-3)
"""Upper ends of the bins [s]; what takes longer falls into one more."""


class StepTimes:
    """Counts of steps by their length."""

    def __init__(self) -> None:
        self.counts = [0] * (len(BOUNDS) + 1)
        """Steps in each bin."""
        self.total = 0.0
        """Length of all steps together [s]."""

    def add(self, seconds: float) -> None:
        """A step took so long."""
        self.counts[bisect_left(BOUNDS, seconds)] += 1
        self.total += seconds
