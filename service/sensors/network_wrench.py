"""A force/torque sensor on the network (Net F/T), joined with the robot's samples per instant."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from contactsense.service.sensors.checks.plausibility import ReadingCheck
from contactsense.service.sensors.checks.recent_trouble import LOST_READINGS
from contactsense.service.sensors.clients import netft_client as netft
from contactsense.service.sensors.clients.netft_client import NetFtStream, WrenchRecord
from contactsense.service.sensors.clients.robot_stream import NS, RobotRecord
from contactsense.service.sensors.time_alignment import Aligned, Aligner

_LOST = 0.75
"""If readings arrive for this long without matching any sample, the estimate of a clock is wrong [s], unless
they are late: which is known within two blocks of arrivals."""
_UNALIGNED = 20.0
"""If the clocks are not aligned for this long although readings arrive, what was learned of them misleads
[s]; a busy host takes a few seconds."""
_COUNT_EVERY = 0.1
"""Lost readings are counted once in this time [s]."""
_OUTAGE = 0.5
"""Readings that are missing after a longer silence are those of an outage, which the state reports [s]."""
_FASTEST = 10_000.0
"""No sensor sends more readings [1/s]: where more are missing, its numbers have jumped."""
_ALIVE = 0.05
"""If the sensor is silent for longer than this, samples no longer wait for it [s]."""


@dataclass(frozen=True, slots=True)
class WrenchSource:
    """Where the readings of one force/torque sensor come from: an address, or RTDE fields."""

    host: str | None = None
    """Address of a Net F/T sensor; None: the reading is in `fields`."""
    port: int = netft.DEFAULT_PORT
    """Its UDP port."""
    http_port: int = netft.DEFAULT_HTTP_PORT
    """Port of its configuration page."""
    counts: tuple[float, float] | None = None
    """Counts per newton and newton metre; None: ask the configuration page."""
    fields: tuple[str, ...] = ()
    """RTDE fields that contain the six values [N, Nm], instead of `host`."""


@dataclass(frozen=True, slots=True)
class Timing:
    """How readings are joined with the robot's samples."""

    rate: float | None
    """Rate of the sensor's sequence numbers [Hz]; None: estimated from arrival times."""
    max_age: float
    """An older reading is not used [s]."""
    delay: float
    """Constant delay of the reading, that of the sensor and that of its network [s]."""
    wait: float
    """Maximum time that a robot sample waits for the reading of its instant [s]."""


class NetworkWrench:
    """Readings of one Net F/T sensor at the instants of the robot's samples. It may disconnect and reconnect.

    Args:
        source: Address of the sensor.
        timing: How its readings are joined with the samples.
        check: Tells which readings are left out.
        observe: Called with all readings as they arrive.

    Raises:
        SensorError: The address is invalid.
    """

    def __init__(
        self,
        source: WrenchSource,
        timing: Timing,
        check: ReadingCheck,
        observe: Callable[[Sequence[WrenchRecord]], None],
    ) -> None:
        assert source.host is not None
        self.stream = NetFtStream(
            source.host, port=source.port, http_port=source.http_port, counts=source.counts
        )
        """The sensor's stream."""
        period = None if timing.rate is None else 1.0 / timing.rate
        self._aligner = Aligner(period=period, max_age=timing.max_age, delay=timing.delay)
        self._wait, self._check, self._observe = timing.wait, check, observe
        self._last_ns = 0
        self._counted = (time.monotonic(), 0, 0)
        self._is_sparse = False
        self._aligned = False
        self._without_since = time.monotonic()

    @property
    def is_streaming(self) -> bool:
        """Whether the sensor sends; otherwise the health of `stream` says why not."""
        return self.stream.health.state == "streaming"

    def poll(self) -> None:
        """Take in the readings that have arrived."""
        self._take(self.stream.poll())
        if time.monotonic() - self._counted[0] >= _COUNT_EVERY:
            self._count_losses()

    def observe_robot(self, record: RobotRecord) -> None:
        """Learn the robot's clock from a packet."""
        self._aligner.observe_robot(record.timestamp, record.arrival_ns)

    def at(self, record: RobotRecord) -> Aligned:
        """The reading at the instant of a packet, after waiting for it."""
        if self._is_sparse or self._aligner.is_late:
            # Each of few readings would serve several samples, whose errors then are the same: that looks
            # like a contact. Late readings are older than they seem.
            return Aligned(None, math.inf)
        deadline = record.arrival_ns + int(self._wait * NS)
        while not self._aligner.covers(record.timestamp):
            now = time.monotonic_ns()
            if now >= deadline or now - self._last_ns > _ALIVE * NS:
                break
            self._take(self.stream.poll((deadline - now) / NS))
        return self._aligner.at(record.timestamp)

    def note(self, there: bool) -> None:
        """Whether the newest sample had a reading: without any for a while, the clocks are aligned anew."""
        now = time.monotonic()
        aligned = self._aligner.ready
        if self._aligner.robot_is_late:
            self._check.note("robot late")
        if there or aligned != self._aligned:
            self._without_since, self._aligned = now, aligned
        silent = now - self._last_ns / NS
        if silent > _LOST:
            self._without_since = now
        if there or silent >= _ALIVE:
            return
        if not aligned:
            self._check.note("unaligned")
        elif self._aligner.is_late:
            self._check.note("late")
        if aligned and (self._is_sparse or self._aligner.is_late):
            # The clocks are known: aligned anew, late readings would be taken for those of a later instant.
            self._without_since = now
        if now - self._without_since > (_LOST if aligned else _UNALIGNED):
            # Which of the two clocks is wrong cannot be determined.
            self._aligner.forget()
            self._without_since, self._aligned = now, False

    def close(self) -> None:
        """Close the connection."""
        self.stream.close()

    def _count_losses(self) -> None:
        """Count the readings that have arrived and those that are missing between them."""
        health, now = self.stream.health, time.monotonic()
        before, received, lost = self._counted
        if health.received == received:
            return
        self._counted = (now, health.received, health.lost)
        arrived, missing = health.received - received, health.lost - lost
        if now - before < _OUTAGE and missing < _FASTEST * (now - before):
            self._check.note("received", count=arrived)
            self._check.note("lost", count=missing)
            self._is_sparse = missing > LOST_READINGS * (arrived + missing)

    def _take(self, readings: Sequence[WrenchRecord]) -> None:
        self._observe(readings)
        for reading in readings:
            # A repeated reading is as old as its first occurrence.
            if self._check.believes(reading.arrival_ns / NS, reading.wrench, 0.0):
                self._aligner.add(*reading)
                self._last_ns = reading.arrival_ns
