"""What every stream of robot samples delivers, whichever client reads it, and how losses are counted."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol

from contactsense.service.wire.recipe import Number

State = Literal["connecting", "streaming", "waiting", "closed"]

NS = 1_000_000_000
"""Nanoseconds in a second."""

_LATE = 0.5
"""A stamp older than the newest by less than this is a late packet, not another clock [s]."""
_LATE_IN_A_ROW = 10
"""So many late packets one after another: the clock was set back after all."""

_SLACK = 1.0
"""How far the robot's clock may run ahead of the host's between two packets and be no jump [s]."""


class SensorError(Exception):
    """A sensor cannot be read; the text says which, why, and what was expected."""


class RobotRecord(NamedTuple):
    """One packet from the robot."""

    timestamp: float
    """Time on the robot's clock [s]."""
    arrival_ns: int
    """When the host saw it, on the host's monotonic clock [ns]."""
    values: tuple[Number, ...]
    """Numbers of all fields, laid out by the stream's `slices`."""


@dataclass(slots=True)
class StreamHealth:
    """What a stream has been through since it was opened."""

    state: State = "connecting"
    """`connecting`: no data yet; `streaming`; `waiting`: down, the next attempt follows; `closed`: by us."""
    error: str = ""
    """The latest trouble, one line for a person; stays after recovery."""
    received: int = 0
    """Records delivered."""
    lost: int = 0
    """Samples that the robot took and we never saw, by gaps in its time stamps (outages included)."""
    duplicates: int = 0
    """Records with the time stamp of the one before; not delivered."""
    out_of_order: int = 0
    """Records older than the one before, such as swapped packets; not delivered."""
    bad_stamps: int = 0
    """Records whose time stamp is not a number; not delivered."""
    jumps: int = 0
    """How often the robot's clock jumped, back or far ahead: a restart, or another robot."""
    failures: int = 0
    """Attempts and connections that ended in an error, bad packets included."""
    connections: int = 0
    """Connections that delivered data."""


class RobotStream(Protocol):
    """A stream of robot records that never gives up; both RTDE sources are one."""

    @property
    def slices(self) -> Mapping[str, slice]:
        """Field name -> where its numbers stand in `RobotRecord.values`."""

    @property
    def health(self) -> StreamHealth:
        """Counters and the latest trouble."""

    def poll(self, timeout: float) -> list[RobotRecord]:
        """Records that have come, oldest first; waits up to `timeout` seconds for the first."""

    def close(self) -> None:
        """Let go of the robot."""


class LossCounter:
    """Counts lost, repeated and misdated samples of a stream with a fixed period [s]."""

    def __init__(self, period: float, health: StreamHealth) -> None:
        self._period = period
        self._health = health
        self._last: RobotRecord | None = None
        self._late = 0

    def admit(self, record: RobotRecord) -> bool:
        """Count the record in; False where it must not be delivered: repeated, late, or without a time."""
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
            if -_LATE < step < 0.0 and self._late < _LATE_IN_A_ROW:
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
    """When to try again: soon at first, then at doubled intervals up to a limit [s]."""

    def __init__(self, first: float = 0.1, limit: float = 1.0) -> None:
        self._first = first
        self._limit = limit
        self._delay = first
        self._due_ns = 0

    def succeeded(self) -> None:
        """The sensor works: start over with short intervals next time."""
        self._delay = self._first

    def failed(self, now_ns: int) -> None:
        """An attempt failed at this instant."""
        self._due_ns = now_ns + int(self._delay * NS)
        self._delay = min(2.0 * self._delay, self._limit)

    def wait(self, now_ns: int) -> float:
        """Seconds until the next attempt is due; 0 if it is."""
        return max(0.0, (self._due_ns - now_ns) / NS)
