"""A force/torque sensor's box whose counter or clock misleads: the reader starts anew instead of waiting."""

import time
from collections.abc import Iterator, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pynetft
import pytest

from contactsense.service.sensors import network_wrench
from contactsense.service.sensors.checks.plausibility import ReadingCheck, RecentCounts, SensorEvent
from contactsense.service.sensors.checks.stuck_channels import ArmState
from contactsense.service.sensors.clients import netft_client
from contactsense.service.sensors.clients.netft_client import NetFtStream, WrenchRecord
from contactsense.service.sensors.clients.robot_stream import RobotRecord
from contactsense.service.sensors.network_wrench import NetworkWrench, Timing, WrenchSource
from contactsense.service.sensors.time_alignment import Aligned
from contactsense.service.sensors.wrench_reader import WrenchReader

NS = 1_000_000_000


class Refusing:
    """A client of pynetft that hears the sensor and takes none of its records."""

    started = 0

    def __init__(self, *_: object, **__: object) -> None:
        self.refused = 0

    def start(self) -> None:
        Refusing.started += 1

    def stop(self) -> None:
        pass

    def samples(self, timeout: float) -> Iterator[Any]:
        self.refused += 5
        yield from ()
        raise TimeoutError

    def health(self) -> object:
        """All counters 0 but one."""
        counts = {name: 0 for name in pynetft.Health.__dataclass_fields__ if name.endswith("_count")}
        counts["ft_backward_count"] = self.refused
        return SimpleNamespace(
            **counts,
            last_error="",
            state=pynetft.ClientState.STREAMING,
            receive_rate_hz=1e3,
            last_record_age=0.0,
        )


def test_a_client_that_takes_records_for_old_ones_is_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pynetft, "Client", Refusing)
    now = time.monotonic()
    clock = SimpleNamespace(monotonic=lambda: now, monotonic_ns=lambda: round(now * NS))
    monkeypatch.setattr(netft_client, "time", clock)
    stream = NetFtStream("127.0.0.1", counts=(1.0, 1.0))
    before = Refusing.started
    for _ in range(20):
        now += 0.05
        stream.poll()
    assert Refusing.started > before
    assert stream.health.restarts > 0
    assert "counts its readings anew" in stream.health.error


class Box:
    """A simulated robot and sensor, each with a clock of its own, and the reader between them."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **timing: float | None) -> None:
        self.ns, self.tick, self.stamp = 50 * NS, 1000, 7.0
        self.waited = 0
        self.late = 0.0
        """By how much readings arrive later [s]."""
        self.sends = True
        """Whether the sensor does."""
        self.observed = 0
        """Number of readings that the reader has passed on."""
        self.aligned = Aligned(None, 0.0)
        """Of the newest packet."""
        self.recent = RecentCounts()
        self.health = SimpleNamespace(state="streaming", received=0, lost=0)
        self.queue: list[WrenchRecord] = []
        monkeypatch.setattr(network_wrench, "NetFtStream", lambda *_, **__: self)
        clock = SimpleNamespace(monotonic=lambda: self.now / NS, monotonic_ns=lambda: self.now)
        monkeypatch.setattr(network_wrench, "time", clock)
        self.reader = NetworkWrench(
            WrenchSource("sensor"),
            Timing(**{"rate": None, "max_age": 0.005, "delay": 0.0, "wait": 0.003, **timing}),  # type: ignore[arg-type]
            ReadingCheck("base_wrench", False, self.recent, ArmState()),
            self.observe,
        )

    def observe(self, readings: Sequence[WrenchRecord]) -> None:
        """Count them."""
        self.observed += len(readings)

    @property
    def now(self) -> int:
        """Host time [ns]."""
        return self.ns + self.waited

    def poll(self, timeout: float = 0.0) -> list[WrenchRecord]:
        """What has arrived, after waiting for it."""
        end = self.now + round(timeout * NS)
        arrival = self.queue[0].arrival_ns if self.queue else end
        self.waited += min(max(arrival, self.now), end) - self.now
        found = [record for record in self.queue if record.arrival_ns <= self.now]
        self.queue = self.queue[len(found) :]
        return found

    def run(self, duration: float) -> float:
        """Fraction of the robot's samples within that time [s] that had a reading."""
        there = []
        for _ in range(round(duration * 500)):
            for _ in range(2):
                self.ns += NS // 1000
                self.tick += 1
                at = self.ns + round(self.late * NS)
                if self.sends:
                    self.queue.append(WrenchRecord(self.tick & 0xFFFFFFFF, at, (self.tick, 0, 0, 0, 0, 0)))
            self.stamp += 0.002
            self.waited = 0
            record = RobotRecord(self.stamp, self.ns, ())
            self.reader.poll()
            self.reader.observe_robot(record)
            self.aligned = self.reader.at(record)
            self.reader.note(self.aligned.wrench is not None)
            there.append(self.aligned.wrench is not None)
        return sum(there) / len(there)


def test_a_robot_clock_that_stood_still_is_learned_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    box = Box(monkeypatch)
    box.run(1.0)
    assert box.run(1.0) == 1.0
    # The controller stalls for longer than readings are kept, and stamps its packets as if it had not.
    for _ in range(6000):
        box.ns += NS // 1000
        box.tick += 1
        box.queue.append(WrenchRecord(box.tick, box.ns, (box.tick, 0, 0, 0, 0, 0)))
    box.run(2.0)
    assert box.run(1.0) == 1.0


@pytest.mark.parametrize(("wait", "waited"), [(0.001, 0.001), (0.003, 0.002)])
def test_a_sample_waits_for_the_reading_of_its_instant(
    monkeypatch: pytest.MonkeyPatch, wait: float, waited: float
) -> None:
    """It comes 2 ms later; a sample waits no longer than allowed, and not at all for a silent sensor."""
    box = Box(monkeypatch, delay=0.002, wait=wait)
    box.late = 0.002
    box.run(2.0)
    assert box.aligned.wrench is not None
    assert box.waited == pytest.approx(waited * NS, abs=1000)
    assert box.aligned.age == pytest.approx(0.002 - waited, abs=1e-6)
    assert box.aligned.wrench[0] + 1000.0 * box.aligned.age == pytest.approx(box.tick, abs=1e-3)
    assert box.observed == box.tick - 1000 - 2 + round(1000 * waited)
    box.sends = False
    box.run(0.06)
    assert (box.waited, box.aligned.wrench) == (0, None)


@pytest.mark.parametrize(("max_age", "used"), [(0.0055, 0.2), (0.0135, 0.6)])
def test_a_reading_is_used_until_it_is_too_old(
    monkeypatch: pytest.MonkeyPatch, max_age: float, used: float
) -> None:
    box = Box(monkeypatch, max_age=max_age)
    box.run(2.0)
    box.sends = False
    assert box.run(0.02) == pytest.approx(used)


@pytest.mark.parametrize(("rate", "used"), [(1000.0, 1.0), (500.0, 0.0)])
def test_the_rate_that_is_stated_counts(monkeypatch: pytest.MonkeyPatch, rate: float, used: float) -> None:
    """The sensor numbers its readings at 1 kHz; with another rate they are those of other times."""
    box = Box(monkeypatch, rate=rate)
    box.run(1.0)
    assert box.run(0.5) == used


@pytest.mark.parametrize("silence", [0.03, 5.0])
def test_a_sensor_that_was_silent_keeps_its_clock(monkeypatch: pytest.MonkeyPatch, silence: float) -> None:
    box = Box(monkeypatch)
    box.run(2.0)
    box.sends = False
    box.run(silence)
    box.sends = True
    assert box.run(0.1) == 1.0


def test_samples_without_a_reading_are_counted_with_their_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    """While the sensor sends: of one that is silent its state tells."""

    def counted(cause: str) -> int:
        return box.recent.totals(time.monotonic())[SensorEvent("base_wrench", cause)]

    box = Box(monkeypatch)
    box.sends = False
    box.run(0.1)
    assert counted("unaligned") == 0
    box.sends = True
    box.run(0.1)
    assert counted("unaligned") == 50
    box.run(5.9)
    assert counted("late") == 0
    box.late = 0.02
    assert box.run(1.0) < 0.5
    assert counted("late") > 200
    assert counted("unaligned") < 250


@pytest.mark.slow
@pytest.mark.parametrize("late", [0.007, 0.02])
def test_late_readings_are_left_out_until_they_are_in_time_again(
    monkeypatch: pytest.MonkeyPatch, late: float
) -> None:
    """Also those that would not be too late for their samples."""
    box = Box(monkeypatch)
    box.run(6.0)
    box.late = late
    assert box.run(100.0) < 0.01
    assert box.recent.totals(time.monotonic())[SensorEvent("base_wrench", "late")] > 400
    box.late = 0.0
    box.queue.clear()  # what was on its way is lost
    box.run(0.6)  # which a whole block of arrivals shows
    assert box.run(1.0) == 1.0


@pytest.mark.parametrize(("lost", "received"), [(30, 70), (90, 10), (5000, 100)])
def test_lost_readings_are_counted(monkeypatch: pytest.MonkeyPatch, lost: int, received: int) -> None:
    """But not those that are missing where the sensor's numbers jump."""
    box = Box(monkeypatch)
    for _ in range(20):
        box.run(0.1)
        box.health.lost += lost
        box.health.received += received
    counts = box.recent.totals(time.monotonic())
    share = counts[SensorEvent("base_wrench", "lost")] / (counts[SensorEvent("base_wrench", "received")] or 1)
    # The window of a real second may begin between the two counts of a tenth of it.
    assert share == pytest.approx(0.0 if lost == 5000 else lost / received, rel=0.2)


def test_nothing_is_used_while_most_readings_are_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    box = Box(monkeypatch)
    box.run(2.0)
    for lost, used in ((30, 1.0), (90, 0.0), (30, 1.0)):
        for _ in range(30):
            box.health.lost += lost
            box.health.received += 100 - lost
            there = box.run(0.1)
        assert there == used
    assert box.recent.totals(time.monotonic())[SensorEvent("base_wrench", "late")] == 0


def test_readings_missing_after_an_outage_are_not_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    box = Box(monkeypatch)
    box.run(1.0)
    box.health.received += 100
    box.run(0.2)
    box.run(1.0)
    box.health.received, box.health.lost = box.health.received + 100, box.health.lost + 1000
    box.run(0.2)
    assert box.recent.totals(time.monotonic())[SensorEvent("base_wrench", "lost")] == 0


def test_damaged_numbers_while_the_clocks_are_learned_are_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    box = Box(monkeypatch)
    # Each of them might be the first of a sensor that counts fast.
    for ahead in (1 << 29, 1 << 30, 3 << 29):
        box.tick += ahead
        box.run(0.002)
    box.run(25.0)
    assert box.run(1.0) == 1.0


@pytest.mark.parametrize(("state", "lacking"), [("waiting", 0), ("streaming", 1)])
def test_a_sample_lacks_a_reading_only_while_the_sensor_sends(
    monkeypatch: pytest.MonkeyPatch, state: str, lacking: int
) -> None:
    """Of a sensor that is away its state tells; shares would tell of it long after it is back."""
    box, recent = Box(monkeypatch), RecentCounts()
    box.health = SimpleNamespace(state=state, received=0, lost=0)
    check = ReadingCheck("base_wrench", False, recent, ArmState())
    reader = WrenchReader(lambda _, reading: reading, check, box.reader)
    assert reader.at(RobotRecord(7.0, box.ns, ()), np.zeros(6)).wrench is None
    assert recent.totals(time.monotonic())[SensorEvent("base_wrench", "lacking")] == lacking
