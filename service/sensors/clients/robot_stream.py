"""Common interface of the streams of robot samples, and the counting of losses."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol

from contactsense.service.wire.recipe import Number

State = Literal["connecting", "streaming", "waiting", "closed"]

NS = 1_000_000_000
"""Nanoseconds in a second."""

LATE = 0.5
"""A packet whose time stamp is older than the newest by less than this is late; otherwise the clock was reset
[s]."""
LATE_IN_A_ROW = 10
"""After this many consecutive late packets, the clock was reset after all."""

_SLACK = 1.0
"""If the robot's clock advances more than this relative to the host's between two packets, it jumped [s]."""


class SensorError(Exception):
    """A sensor cannot be read; the text says which, why, and what was expected."""


class RobotRecord(NamedTuple):
    """One packet from the robot."""

    timestamp: float
    """Time on the robot's clock [s]."""
    arrival_ns: int
    """Time of reception on the host's monotonic clock [ns]."""
    values: tuple[Number, ...]
    """Values of all fields; the stream's `slices` gives their positions."""


@dataclass(slots=True)
class StreamHealth:
    """Statistics of a stream since it was opened."""

    state: State = "connecting"
    """`connecting`: no data yet; `streaming`; `waiting`: disconnected, waiting for the next attempt;
    `closed`: by us."""
    error: str = ""
    """The latest problem in one readable line; kept after recovery."""
    received: int = 0
    """Records delivered."""
    lost: int = 0
    """Samples that the robot took but we did not receive, by gaps in its time stamps (including outages)."""
    duplicates: int = 0
    """Records with the same time stamp as the previous one; not delivered."""
    out_of_order: int = 0
    """Records older than the previous one, such as swapped packets; not delivered."""
    bad_stamps: int = 0
    """Records whose time stamp is not a number; not delivered."""
    jumps: int = 0
    """How often the robot's clock jumped backwards or far ahead: a restart, or another robot."""
    failures: int = 0
    """Attempts and connections that ended in an error, including bad packets."""
    connections: int = 0
    """Connections that delivered data."""


class RobotStream(Protocol):
    """A stream of robot records that reconnects forever; both RTDE sources implement it."""

    @property
    def slices(self) -> Mapping[str, slice]:
        """Field name -> position of its values in `RobotRecord.values`."""

    @property
    def health(self) -> StreamHealth:
        """Counters and the latest problem."""

    def poll(self, timeout: float) -> list[RobotRecord]:
        """Records received, oldest first; waits up to `timeout` seconds for the first."""

    def close(self) -> None:
        """Close the connection to the robot."""


class LossCounter:
    """Counts lost, repeated and wrongly timed samples of a stream with a fixed period [s]."""

    def __init__(self, period: float, health: StreamHealth) -> None:
        self._period = period
        self._health = health
        self._last: RobotRecord | None = None
        self._late = 0

    def admit(self, record: RobotRecord) -> bool:
        """Count the record; False if it must not be delivered because it is repeated, late, or without a
        time."""
        health = self._health
        if not math.isfinite(record.timestamp):
            health.failures += 1
            health.bad_stamps += 1
            health.error = f"the robot sent the time stamp {record.timestamp}"
            return False
        last = self._last
        if last is not None:
            step = record.timestamp - last.timestamp
            if step == 0.0:
                health.duplicates += 1
                return False
            if -LATE < step < 0.0 and self._late < LATE_IN_A_ROW:
                self._late += 1
                health.out_of_order += 1
                return False
        self._last, self._late = record, 0
        if last is not None:
            step = record.timestamp - last.timestamp
            if step < 0.0 or step > (record.arrival_ns - last.arrival_ns) / NS + _SLACK:
                health.jumps += 1
            else:
                health.lost += max(0, round(step / self._period) - 1)
        health.received += 1
        return True


class Backoff:
    """Time of the next attempt: soon at first, then at doubled intervals up to a limit [s]."""

    def __init__(self, first: float = 0.1, limit: float = 1.0) -> None:
        self._first = first
        self._limit = limit
        self._delay = first
        self._due_ns = 0

    def succeeded(self) -> None:
        """The sensor works: start again with short intervals after the next failure."""
        self._delay = self._first

    def failed(self, now_ns: int) -> None:
        """Record that an attempt failed at this instant."""
        self._due_ns = now_ns + int(self._delay * NS)
        self._delay = min(2.0 * self._delay, self._limit)

    def wait(self, now_ns: int) -> float:
        """Seconds until the next attempt is due; 0 if it is due now."""
        return max(0.0, (self._due_ns - now_ns) / NS)
