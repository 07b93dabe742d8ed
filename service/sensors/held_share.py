"""A share that is told while it is large, without flapping around its limit."""

from collections import deque

HOLD = 3.0
"""A share must have been clearly below its limit for this time before it is told no more [s]."""
CLEARLY = 0.5
"""Part of the limit that counts as clearly below it."""


class HeldShare:
    """Tells a share from the moment it exceeds its limit until it has been clearly below it for `HOLD`.

    Args:
        limit: A larger share is told.
    """

    def __init__(self, limit: float) -> None:
        self._limit = limit
        self._told = False
        self._recent: deque[tuple[float, float]] = deque()

    def update(self, now: float, share: float) -> float:
        """Largest share within the last `HOLD` while it is told; 0 otherwise.

        Args:
            now: Time [s], on any monotonic clock.
            share: The present one.
        """
        while self._recent and self._recent[0][0] < now - HOLD:
            self._recent.popleft()
        # Of earlier shares only those that are larger than all later ones can still be the largest.
        while self._recent and self._recent[-1][1] <= share:
            self._recent.pop()
        self._recent.append((now, share))
        largest = self._recent[0][1]
        self._told = largest > (CLEARLY * self._limit if self._told else self._limit)
        return largest if self._told else 0.0
