"""Plausibility of readings: values that never change or are no numbers, and counts of recent problems.

Measured values carry noise. In 77,000 packets of a real UR10e (100 Hz, at rest and in motion; shamilmamedov,
dynamic_calibration) the six motor currents never had the same values twice in a row, while joint positions
at rest repeat for up to 1.2 s and velocities for up to 7.8 s.
"""

import math
import time
from collections import Counter, deque
from collections.abc import Hashable, Sequence
from typing import NamedTuple

import numpy as np

from contactsense.service.sensors.checks.stuck_channels import ArmState, StuckChannels

REPEAT_LIMIT = 0.04
"""A noisy signal that has repeated all its values for longer than this is reported as frozen [s]."""
MOTION_LIMIT = 2e-4
"""Positions that repeat while the integrated velocities exceed this are stale [rad]."""
REST_SPEED = 1e-3
"""No joint of an arm at rest is faster than this; its positions may repeat [rad/s]."""
SPEED_SCALE = 3.0
"""A velocity above this multiple of the joint's limit is invalid. Limits in robot descriptions are those of
the drives; a packet with missing bytes can contain any number."""


class RepeatCheck:
    """Measures for how long a signal has repeated the same values."""

    def __init__(self) -> None:
        self._last: Hashable = None
        self._since = 0.0

    def update(self, t: float, values: Hashable) -> float:
        """Time for which the values have been constant [s]; 0 while they change.

        Args:
            t: Time of the reading [s], on any monotonic clock.
            values: The reading as received, before any conversion.
        """
        if values != self._last or t < self._since:
            self._last, self._since = values, t
            return 0.0
        return t - self._since


class RobotCheck:
    """Detects positions and velocities that cannot be used, such as old values with new time stamps.

    Each value counts once: repeated noise does not average out, and the observers take it for a contact.

    At rest, positions and velocities may repeat, so the torques decide there: they are measured and therefore
    noisy. A stale packet among current ones looks like a contact within a few milliseconds, so the first
    repetition counts.

    Args:
        speed_limits: Largest speed of each joint, shape (n,) [rad/s]; infinite if unknown.
    """

    def __init__(self, speed_limits: np.ndarray) -> None:
        self._fastest = SPEED_SCALE * speed_limits
        self._last_q: tuple[float, ...] = ()
        self._last_t = 0.0
        self._moved = 0.0
        self._state = RepeatCheck()

    def velocities_impossible(self, qd: np.ndarray) -> bool:
        """Whether a velocity is far above what the joint can reach.

        Args:
            qd: Joint velocities, shape (n,) [rad/s].
        """
        return bool((np.abs(qd) > self._fastest).any())

    def positions_stale(self, t: float, q: np.ndarray, qd: np.ndarray) -> bool:
        """Whether the positions repeat although the velocities say that the arm moves.

        Args:
            t: Time of the sample on the robot's clock [s].
            q: Joint positions, shape (n,) [rad].
            qd: Joint velocities, shape (n,) [rad/s].
        """
        values = tuple(q.tolist())
        step = t - self._last_t
        self._last_t = t
        if values != self._last_q or not 0.0 < step < 1.0:
            self._last_q, self._moved = values, 0.0
            return False
        speed = float(np.abs(qd).max())
        # A single wrong velocity must not accumulate while the arm is at rest afterwards.
        self._moved = self._moved + step * speed if speed > REST_SPEED else 0.0
        return self._moved > MOTION_LIMIT

    def all_repeats(self, t: float, values: tuple[float, ...]) -> float:
        """Time for which all values that the robot sends, including torques, have repeated [s]."""
        return self._state.update(t, values)


class SensorEvent(NamedTuple):
    """A kind of event at one of several sensors."""

    field: str
    """Field of the scene: `joint_torque`, `base_wrench`, or a key of `Scene.link_sensors`."""
    what: str
    """The kind."""
    channel: int | None = None
    """Which of the signal's values; None: the event is one of the whole reading."""


Event = str | SensorEvent
"""A kind of event."""


class RecentCounts:
    """Counts of each kind of event within a recent time window.

    Args:
        window: Length of the window [s].
    """

    def __init__(self, window: float = 1.0) -> None:
        self._window = window
        self._buckets: deque[tuple[int, Counter[Event]]] = deque()
        self._width = window / 10.0

    def add(self, now: float, what: Event, count: int = 1) -> None:
        """Add `count` events at `now`, a time on the host's monotonic clock [s]."""
        number = math.floor(now / self._width)
        if not self._buckets or self._buckets[-1][0] != number:
            self._buckets.append((number, Counter()))
            self._expire(now)
        self._buckets[-1][1][what] += count

    def totals(self, now: float) -> Counter[Event]:
        """Counts of all events within the window before `now`."""
        self._expire(now)
        total: Counter[Event] = Counter()
        for _, counts in self._buckets:
            total.update(counts)
        return total

    def _expire(self, now: float) -> None:
        oldest = math.floor((now - self._window) / self._width)
        while self._buckets and self._buckets[0][0] <= oldest:
            self._buckets.popleft()


class ReadingCheck:
    """Tells which readings of one force/torque sensor cannot be measurements, and counts them.

    Args:
        field: The sensor's field of the scene.
        checked: Whether readings that never change are left out; those of a simulator without noise do not.
        recent: Counts the problems, as `SensorEvent`.
        arm: Whether the arm is at rest.
    """

    def __init__(self, field: str, checked: bool, recent: RecentCounts, arm: ArmState) -> None:
        self.field = field
        self._checked, self._recent, self._arm = checked, recent, arm
        self._repeats = RepeatCheck()
        self._channels = StuckChannels(6, from_start=True)

    def believes(self, t: float, reading: Sequence[float], max_age: float) -> bool:
        """Whether a reading is plausible: numbers, not exactly zero, not constant, and no component stuck.

        Args:
            t: Time of the reading [s], on any monotonic clock.
            reading: As received, before any conversion: a frozen reading changes in base axes with the arm.
            max_age: A reading may be repeated for this time [s].
        """
        if not all(map(math.isfinite, reading)):
            self.note("not finite")
            return False
        values = tuple(reading)
        repeated = self._repeats.update(t, values)
        if not self._checked:
            return True
        if not any(reading):
            self.note("zero")
            return False
        stuck = self._channels.update(values, self._arm.at_rest)
        for channel in stuck:
            self.note("stuck", channel)
        if repeated > REPEAT_LIMIT:
            self.note("frozen")
        return repeated <= max_age and not stuck

    def note(self, what: str, channel: int | None = None, count: int = 1) -> None:
        """Count a problem of this sensor, or of one of its components."""
        self._recent.add(time.monotonic(), SensorEvent(self.field, what, channel), count)
