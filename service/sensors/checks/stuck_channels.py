"""Single channels of a signal that are stuck at a value while its other channels change."""

from collections.abc import Sequence
from dataclasses import dataclass

STUCK_READINGS = 5
"""A channel with the same value in this number of successive readings is stuck. In the recordings of a real
UR10e (100 Hz; shamilmamedov, dynamic_calibration) no motor current had the same value in three successive
packets, except at the damaged end of one file; at rest at most about 1 % of the values repeated the previous
one."""
LARGEST_REPEATS = 0.1
"""A channel that repeats a larger share of its values at rest is too coarse to be checked. White noise
repeats this share where it is 2.8 times as large as the resolution, and five equal values by chance less
than once in 10^4 readings: they are left out, but not reported."""
LEAST_REVERSALS = 0.1
"""A channel that turns less often, from up to down or back, is not noisy: white noise turns at two thirds of
its values, the currents named above at more than half. What a simulator without noise computes for an arm
that comes to rest hardly turns."""
LEAST_SEEN = 50
"""These shares are known from this number of values at rest."""
NEVER_CHANGED = 5000
"""A channel that has not changed in this number of readings of an arm in motion has been stuck from the
start: ten seconds at 500 Hz."""
MOST_SEEN = 400
"""From this number of values on, the older ones begin to be forgotten."""


@dataclass(slots=True)
class ArmState:
    """What the checks of all sensors know of the arm."""

    at_rest: bool = False
    """Whether it was at rest in its latest sample."""


class StuckChannels:
    """Finds channels that are stuck.

    Measured values carry noise, but a channel may be too coarse to show it, and a simulator may have none.
    So a channel is checked once it has changed with nearly every reading while the arm was at rest: there
    only noise changes it, and noise does not stop. It is compared with the other channels: readings that
    repeat as a whole count once, as those of a sensor that is slower than its packets.

    A channel that has never changed has been stuck from the start if all others are noisy and the arm has
    moved for long enough: no load is exactly constant then.

    Args:
        channels: Number of channels.
        from_start: Whether a channel that has never changed may be called stuck. A controller or a
            simulator may send a constant for a joint that has no sensor.
    """

    def __init__(self, channels: int, from_start: bool) -> None:
        self._all = list(range(channels))
        self._never_changed = self._all if from_start else []
        self._moved = 0
        self._last: Sequence[float] = ()
        self._anchor: Sequence[float] = ()
        self._second: Sequence[float] = ()
        self._same: list[int] = []
        self._count = 0
        self._seen = 0
        self._repeats = [0] * channels
        self._reversals = [0] * channels
        self._stuck: tuple[int, ...] = ()

    def update(self, values: Sequence[float], at_rest: bool) -> tuple[int, ...]:
        """The channels that are stuck: each from its fifth to eighth equal value on, until it changes.

        Args:
            values: The reading as received, before any conversion; one value per channel.
            at_rest: Whether the arm is at rest.
        """
        if values == self._last:
            return self._stuck
        self._last = values
        if self._count == 0:
            self._begin(values)
            return ()
        # Of a noisy signal nothing is the same after the first reading: this costs next to nothing.
        if self._same:
            self._same = [i for i in self._same if values[i] == self._anchor[i]]
            self._stuck = tuple(i for i in self._stuck if i in self._same)
        self._count += 1
        if self._count == 2:
            self._second = values
            if at_rest:
                self._learn()
        elif self._count == 3 and at_rest:
            self._count_reversals(values)
        elif self._count == STUCK_READINGS:
            self._never_changed = [i for i in self._never_changed if i in self._same]
            self._moved += 0 if at_rest else STUCK_READINGS - 1
            self._stuck = tuple(i for i in self._same if i in self._stuck or self._is_judged(i))
            self._begin(values)
        return self._stuck

    def _begin(self, values: Sequence[float]) -> None:
        """Compare the next readings with this one."""
        self._anchor, self._same, self._count = values, self._all, 1

    def _learn(self) -> None:
        """Count the values at rest that repeat the one before."""
        if self._seen >= MOST_SEEN:
            self._seen //= 2
            self._repeats = [count // 2 for count in self._repeats]
            self._reversals = [count // 2 for count in self._reversals]
        self._seen += 1
        for i in self._same:
            # A stuck channel must not become one that is too coarse.
            if i not in self._stuck:
                self._repeats[i] += 1

    def _count_reversals(self, third: Sequence[float]) -> None:
        """Count where the third value turns back."""
        for i, (first, second, last) in enumerate(zip(self._anchor, self._second, third, strict=True)):
            if (second - first) * (last - second) < 0.0 and i not in self._stuck:
                self._reversals[i] += 1

    def _is_judged(self, channel: int) -> bool:
        if channel in self._never_changed:
            return self._moved >= NEVER_CHANGED and all(self._is_noisy(i) for i in self._all if i != channel)
        return self._is_noisy(channel)

    def _is_noisy(self, channel: int) -> bool:
        if self._seen < LEAST_SEEN or self._repeats[channel] > LARGEST_REPEATS * self._seen:
            return False
        return self._reversals[channel] >= LEAST_REVERSALS * self._seen
