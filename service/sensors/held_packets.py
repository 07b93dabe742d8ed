"""Packets of the robot that wait for readings that come in later ones."""

from collections import deque
from collections.abc import Iterator

from contactsense.service.sensors.clients.robot_stream import NS, RobotRecord
from contactsense.service.sensors.field_wrench import SAME_INSTANT

_SILENCE = 0.05
"""A robot that has been silent for this long beyond the wait sends no later packets for now [s]."""


class HeldPackets:
    """Packets in their order, each until one has arrived that is `wait` later on the robot's clock.

    Args:
        wait: Time that a packet waits [s].
    """

    def __init__(self, wait: float) -> None:
        self._wait = wait
        self._held: deque[RobotRecord] = deque()

    def after(self, newest: RobotRecord) -> Iterator[RobotRecord]:
        """Add a packet, and take those whose wait it ends."""
        self._held.append(newest)
        while self._held:
            waited = newest.timestamp - self._held[0].timestamp
            # A clock that was set back says nothing of the packets before.
            if 0.0 <= waited < self._wait - SAME_INSTANT:
                return
            yield self._held.popleft()

    def overdue(self, now_ns: int) -> Iterator[RobotRecord]:
        """Take the packets for which no later one has come.

        Args:
            now_ns: The host's monotonic clock [ns].
        """
        while self._held and now_ns - self._held[0].arrival_ns > (self._wait + _SILENCE) * NS:
            yield self._held.popleft()
