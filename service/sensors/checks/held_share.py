"""A share that is reported while it is large, without flapping around its limit."""

from collections import deque
from math import inf

HOLD = 0.5
"""A share must have been clearly below its limit for this time before it is no longer reported [s]: short,
so that a fault that is over does not look like one that lasts."""
LONGEST = 4.0
"""Longest hold of a share that keeps returning, as on a busy computer [s]."""
SOON = 2.0
"""A share that is reported again within this time returns: it is held twice as long as before [s]."""
CLEARLY = 0.5
"""Part of the limit that counts as clearly below it."""


class HeldShare:
    """Reports a share from the moment it exceeds its limit until it has been clearly below it for some time.

    That time doubles whenever the share returns soon, as pauses do in exponential backoff.

    Args:
        limit: A larger share is reported.
    """

    def __init__(self, limit: float) -> None:
        self._limit = limit
        self._reported = False
        self._hold = HOLD
        self._ended = -inf
        self._recent: deque[tuple[float, float]] = deque()

    def update(self, now: float, share: float) -> float:
        """Largest share within the hold while it is reported; 0 otherwise.

        Args:
            now: Time [s], on any monotonic clock.
            share: The present one.
        """
        while self._recent and self._recent[0][0] < now - self._hold:
            self._recent.popleft()
        # Of earlier shares only those that are larger than all later ones can still be the largest.
        while self._recent and self._recent[-1][1] <= share:
            self._recent.pop()
        self._recent.append((now, share))
        largest = self._recent[0][1]
        reported = largest > (CLEARLY * self._limit if self._reported else self._limit)
        if reported and not self._reported:
            self._hold = min(2.0 * self._hold, LONGEST) if now - self._ended < SOON else HOLD
        elif self._reported and not reported:
            self._ended = now
        self._reported = reported
        return largest if reported else 0.0
