"""Time alignment of two sensors with separate clocks: the force/torque reading at the time of a robot sample.

This module reads no clock. Each stream provides readings with the time of its own clock, and the host time of
their arrival. Arrivals are late, never early, so the line below all (own time, arrival) points is the
sensor's clock in host time plus the minimum network delay (S. B. Moon et al., "Estimation and removal of
clock skew from network delay measurements", INFOCOM 1999). A constant delay cannot be determined this way; if
it differs between the two streams, `Aligner(delay=...)` subtracts the difference.

A stream that becomes later, as behind a proxy that buffers, is late against that line. Its clock is not
learned from late arrivals: otherwise the line would tilt and rise to them within a minute, and readings would
be taken for those of another instant. A clock that stood still looks the same, so lateness is reported.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

_BLOCK = 0.25
"""From each block of this length only the least delayed arrival is kept [s]."""
_FIRST_BLOCK = 0.02
"""The same at the start, when every arrival adds information [s]."""
_BLOCKS = 240
"""Number of past blocks that are used: one minute."""
_START = 0.2
"""Arrivals over this time are needed before times are estimated [s]."""
_SUPPORT, _TOLERANCE = 8, 1e-3
"""So many of the least delayed arrivals must agree within this tolerance [s]: on a busy host, the first ones
may all be late, each by another delay."""
_TRUST = 2.0
"""From this time on, the estimated period is better than the given one [s]."""
_AHEAD = 0.5
"""If readings or time stamps are ahead of their arrivals by more than this, the clock was reset [s]."""
_LATE = 5e-3
"""If all arrivals of a block are late by more than this, the stream has become later [s]. A busy host is not
the reason: the last of the readings that it hears at once is in time."""
_LATEST = 1.0
"""If they are later than this, the sensor's clock stood still rather than the stream [s]."""
_LASTING = 10.0
"""A robot that has been late for this long is reported [s]: if the network is slow for a while, that does no
harm."""
_ESTABLISHED = 5.0
"""Arrivals of this time must agree with the line before others can be called late: earlier the estimated rate
may be wrong [s]."""
_DOUBTFUL = 0.5
"""If all arrivals are late for this long before that, the line is wrong [s]; a busy host is late for less."""
_NEARLY = 0.9
"""Edges of the hull with which nearly as many arrivals agree are as good [share]."""
_SKEW = 5e-4
"""Quartz clocks agree within this tolerance; a larger slope error is jitter [s/s]."""


class ClockMap:
    """Maps a sensor's clock to the host's clock: a line below all arrivals.

    Args:
        period: Seconds per unit of the sensor's clock; None if it must be estimated.
    """

    def __init__(self, period: float | None) -> None:
        self._given = period
        self.reset()

    def reset(self) -> None:
        """Discard all points: the sensor's clock was reset."""
        self._origin: tuple[float, int] | None = None
        self._points: deque[tuple[float, float]] = deque(maxlen=_BLOCKS)
        self._block_end = 0.0
        self.ready = False
        """Whether enough readings have arrived to estimate times."""
        self.period = self._given or 0.0
        """Current estimate of the seconds per unit of the sensor's clock."""
        self._offset = 0.0
        self._least = math.inf
        self._heard = 0
        self.late = 0.0
        """By how much the least delayed arrival of the latest complete block is above the line [s]; 0 if too
        few arrived."""
        self.late_for = 0.0
        """For how long all blocks have been late [s]."""
        self._late_from = 0.0
        self.confirmed = 0.0
        """Time of the kept arrivals that agree with the line [s]."""

    @property
    def is_late(self) -> bool:
        """Whether the stream has become later, and is not learned from."""
        return _LATE < self.late < _LATEST and self.confirmed >= _ESTABLISHED

    def observe(self, tick: float, arrival_ns: int) -> None:
        """Add the arrival of a reading: time on the sensor's clock and host time."""
        if self._origin is None:
            self._origin = (tick, arrival_ns)
        x = tick - self._origin[0]
        y = (arrival_ns - self._origin[1]) * 1e-9
        residual = y - self.period * x
        self._offset = min(self._offset, residual)
        if y >= self._block_end or not self._points:
            self._block_end = y + (_BLOCK if y > _TRUST else _FIRST_BLOCK)
            self.late = self._least - self._offset if self._heard >= _SUPPORT else 0.0
            if self.late <= _LATE:
                self._late_from = y
            self.late_for = y - self._late_from
            self._least, self._heard = residual, 1
            if self.is_late:
                self._points.pop()
            self._fit()
            self._points.append((x, y))
            self._offset = min(self._offset, y - self.period * x)
        else:
            self._least, self._heard = min(self._least, residual), self._heard + 1
            last = self._points[-1]
            if residual < last[1] - self.period * last[0]:
                self._points[-1] = (x, y)

    def host(self, tick: float) -> float:
        """Host time since `origin_ns` at which the sensor's clock showed `tick`, plus the minimum delay
        [s]."""
        assert self._origin is not None
        return self._offset + self.period * (tick - self._origin[0])

    def tick(self, host: float) -> float:
        """Time of the sensor's clock at a host time since `origin_ns` [s]."""
        assert self._origin is not None
        return self._origin[0] + (host - self._offset) / self.period

    @property
    def origin_ns(self) -> int:
        """Host time from which `host` counts [ns]."""
        assert self._origin is not None
        return self._origin[1]

    def _fit(self) -> None:
        hull: list[tuple[float, float]] = []
        for p in self._points:
            while len(hull) > 1 and _turn(hull[-2], hull[-1], p) <= 0.0:
                hull.pop()
            if not hull or p[0] > hull[-1][0]:
                hull.append(p)
        points = np.array(self._points).reshape(-1, 2)
        if len(hull) > 1:
            self._learn(_slope(np.array(hull), points), self._stretch)
        delays = points[:, 1] - self.period * points[:, 0]
        self._offset = float(delays.min()) if len(points) else 0.0
        agree = delays - self._offset <= _TOLERANCE
        self.confirmed = float(agree @ _durations(points))
        self.ready = self.ready or (
            self._stretch >= _START and self.period > 0.0 and int(agree.sum()) >= _SUPPORT
        )

    @property
    def _stretch(self) -> float:
        """Time between the first and the last of the arrivals that are kept [s]."""
        return self._points[-1][1] - self._points[0][1] if self._points else 0.0

    def _learn(self, slope: float, stretch: float) -> None:
        if self._given is None:
            if slope > 0.0:
                self.period = slope
        elif stretch >= _TRUST:
            self.period = min(max(slope, self._given * (1.0 - _SKEW)), self._given * (1.0 + _SKEW))


def _slope(hull: np.ndarray, points: np.ndarray) -> float:
    """Slope of the edge of the lower convex hull with which the arrivals of the longest time agree; of those
    that are nearly as good, the one nearest to the centre, where a line below all points is closest to them.

    A stream that begins late, as on a host that is busy at first, has an edge from its beginning to the first
    arrivals in time, which would be that in the centre for as long again.

    Args:
        hull: Corners, shape (k, 2).
        points: All points, shape (n, 2).
    """
    (x0, y0), (x1, y1) = hull[:-1].T, hull[1:].T
    slopes = (y1 - y0) / (x1 - x0)
    above = points[:, 1, None] - y0 - slopes * (points[:, 0, None] - x0)
    agreed = _durations(points) @ (above <= _TOLERANCE)
    centre = 0.5 * (hull[0, 0] + hull[-1, 0])
    distance = np.maximum(0.0, np.maximum(x0 - centre, centre - x1))
    distance[agreed < _NEARLY * agreed.max()] = math.inf
    return float(slopes[distance.argmin()])


def _durations(points: np.ndarray) -> np.ndarray:
    """Time for which each point stands [s], shape (n,)."""
    return np.minimum(np.diff(points[:, 1], append=points[-1:, 1]), _BLOCK)


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


@dataclass(frozen=True, slots=True)
class Aligned:
    """A force/torque value for one instant of the robot."""

    wrench: np.ndarray | None
    """Value at that instant, shape (6,); None if the sensor was silent around it."""
    age: float
    """By how much the value is older than the instant [s]: 0 if readings on both sides were interpolated."""


class Aligner:
    """Keeps the latest force/torque readings and interpolates them at a robot sample's instant.

    Args:
        period: Seconds per unit of the force/torque sensor's clock; None to estimate it from the arrivals.
        max_age: A reading older than this, and older than 1.5 times the interval between two, is not used,
            and a longer gap is not interpolated [s].
        delay: Constant by which the network delay of a reading exceeds that of a robot packet [s].
        keep: Number of readings that are kept.
    """

    def __init__(
        self,
        *,
        period: float | None = None,
        max_age: float = 0.01,
        delay: float = 0.0,
        keep: int = 4096,
    ) -> None:
        self._max_age = max_age
        self._delay = delay
        self._robot = ClockMap(1.0)
        self._sensor = ClockMap(period)
        self._readings: deque[tuple[int, np.ndarray]] = deque(maxlen=keep)
        self._wraps = 0
        self._stride = 0
        self._last: int | None = None
        self._last_arrival_ns = 0
        self._last_time: float | None = None
        self._last_robot_arrival_ns = 0

    def add(self, tick: int, arrival_ns: int, wrench: Sequence[float]) -> None:
        """Add a force/torque reading; `tick` is its time on the sensor's clock, modulo 2^32."""
        if self._last is not None:
            step = (tick - self._last) & 0xFFFFFFFF
            if step == 0:
                return
            ahead = step * self._sensor.period - (arrival_ns - self._last_arrival_ns) * 1e-9
            if step >= 0x80000000 or (self._sensor.ready and ahead > _AHEAD):
                self._sensor.reset()
                self._readings.clear()
                self._wraps = self._stride = 0
                step = 0
            elif tick < self._last:
                self._wraps += 1
            if step:
                self._stride = min(self._stride or step, step)
        self._last, self._last_arrival_ns = tick, arrival_ns
        number = tick + (self._wraps << 32)
        self._sensor.observe(number, arrival_ns)
        self._readings.append((number, np.asarray(wrench, dtype=float)))

    def forget(self) -> None:
        """Estimate both clocks again from the start."""
        self._robot.reset()
        self._sensor.reset()
        self._readings.clear()
        self._wraps, self._last, self._stride = 0, None, 0

    def observe_robot(self, timestamp: float, arrival_ns: int) -> None:
        """Add the time stamp of a robot sample [s] and its arrival."""
        if self._last_time is not None:
            step = timestamp - self._last_time
            # A clock that was set ahead would look like one that ran slow over the whole window.
            if step < 0.0 or step - (arrival_ns - self._last_robot_arrival_ns) * 1e-9 > _AHEAD:
                self._robot.reset()
        self._last_time, self._last_robot_arrival_ns = timestamp, arrival_ns
        self._robot.observe(timestamp, arrival_ns)

    @property
    def ready(self) -> bool:
        """Whether both clocks are known: they have been heard for long enough, and what is known of the
        sensor's fits its latest readings."""
        sensor, robot = self._sensor, self._robot
        unconfirmed = sensor.confirmed < _ESTABLISHED and sensor.late_for > _DOUBTFUL
        wrong = unconfirmed and sensor.late > robot.late + _LATE
        return sensor.ready and robot.ready and not wrong

    @property
    def is_late(self) -> bool:
        """Whether the force/torque readings arrive later than they did, compared with the robot's packets."""
        return self._sensor.is_late and self._sensor.late > self._robot.late + _LATE

    @property
    def robot_is_late(self) -> bool:
        """The same of the robot's packets, for some time."""
        lasts = self._robot.is_late and self._robot.late_for > _LASTING
        return lasts and self._robot.late > self._sensor.late + _LATE

    def covers(self, timestamp: float) -> bool:
        """Whether a reading at or after that instant of the robot (or half an interval between two readings
        before it) has arrived."""
        instant = self._instant(timestamp)
        # Not the latest interval, which is longer after lost readings.
        return instant is not None and instant <= self._readings[-1][0] + 0.5 * self._stride

    def at(self, timestamp: float) -> Aligned:
        """The force/torque value at an instant of the robot's clock [s]."""
        instant = self._instant(timestamp)
        if instant is None:
            return Aligned(None, float("inf"))
        period = self._sensor.period
        max_age = max(self._max_age, 1.5 * self._stride * period)
        newest, wrench = self._readings[-1]
        if instant >= newest:
            age = (instant - newest) * period
            return Aligned(wrench if age <= max_age else None, age)
        later, later_wrench = newest, wrench
        for number, value in islice(reversed(self._readings), 1, None):
            if number <= instant:
                age = (instant - number) * period
                if (later - number) * period <= max_age:
                    share = (instant - number) / (later - number)
                    return Aligned(value + share * (later_wrench - value), 0.0)
                return Aligned(value if age <= max_age else None, age)
            later, later_wrench = number, value
        return Aligned(None, float("inf"))

    def _instant(self, timestamp: float) -> float | None:
        # On the sensor's clock, which does not change while its mapping to the host's clock is refined.
        if not (self._readings and self.ready):
            return None
        host = self._robot.host(timestamp) + (self._robot.origin_ns - self._sensor.origin_ns) * 1e-9
        return self._sensor.tick(host + self._delay)
