"""How far the host's clock has been set."""

import time

_LEAST = 1.0
"""The clock was set if it has gained or lost more than this between two looks [s]; less is its rate."""


class ClockStep:
    """Compares the host's clock with the monotonic one, which nobody sets."""

    def __init__(self) -> None:
        self._ahead = time.time() - time.monotonic()

    def since_last(self) -> float:
        """By how much the clock was set since the last call, or since the start [s]; 0.0: it was not."""
        ahead = time.time() - time.monotonic()
        step, self._ahead = ahead - self._ahead, ahead
        return step if abs(step) > _LEAST else 0.0
