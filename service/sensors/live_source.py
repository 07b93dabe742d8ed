"""Live samples: the robot's stream and the force/torque sensor's, joined per instant."""

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from contactsense.scene import Scene
from contactsense.scene_model.link_sensor_frame import LinkSensorFrame
from contactsense.scene_model.sensor_delays import sensor_delays
from contactsense.scene_model.wrench_map import WrenchMap
from contactsense.sensors.link_values import as_fields
from contactsense.service.sensors.checks.plausibility import (
    REPEAT_LIMIT,
    REST_SPEED,
    ReadingCheck,
    RecentCounts,
    RobotCheck,
)
from contactsense.service.sensors.checks.recent_trouble import RecentTrouble
from contactsense.service.sensors.checks.stuck_channels import ArmState
from contactsense.service.sensors.checks.torque_check import TorqueCheck
from contactsense.service.sensors.checks.velocity_check import VelocityCheck
from contactsense.service.sensors.clients import rtde_client as rtde
from contactsense.service.sensors.clients.netft_client import WrenchRecord
from contactsense.service.sensors.clients.robot_stream import RobotRecord, RobotStream, SensorError
from contactsense.service.sensors.clients.rtde_client import RtdeStream
from contactsense.service.sensors.clients.ur_rtde_client import UrRtdeStream
from contactsense.service.sensors.field_wrench import FieldWrench
from contactsense.service.sensors.held_packets import HeldPackets
from contactsense.service.sensors.network_wrench import NetworkWrench, Timing, WrenchSource
from contactsense.service.sensors.signal_mapping import TorqueMap
from contactsense.service.sensors.source_health import SourceHealth
from contactsense.service.sensors.source_settings import SourceSettings
from contactsense.service.sensors.wrench_reader import WrenchReader, WrenchReading
from contactsense.service.wire.recipe import Number
from contactsense.service.wire.rtde_fields import OUTPUTS, WIDTHS
from contactsense.types import Sample

OUTAGE = 0.5
"""A gap in the robot's stream longer than this is an outage, reported by the state, not packet loss [s]."""
_BASE = "base_wrench"
_NO_READING = WrenchReading(None, None, math.inf)
"""There is no reading for an instant."""


class RawObserver(Protocol):
    """Receives what the sensors deliver, such as `contactsense.service.recordings.writing.recorder`."""

    def robot(
        self,
        record: RobotRecord,
        slices: Mapping[str, slice],
        reading: np.ndarray | None,
        age: float,
        sample: Sample | None,
    ) -> None:
        """One robot packet, the base sensor's reading at its instant, and the sample made of both."""

    def wrench(self, readings: Sequence[WrenchRecord]) -> None:
        """Readings of the networked force/torque sensor."""


class LiveSource:
    """An endless stream of samples. Sensors may disconnect and reconnect: without the robot there are no
    samples, without the other sensor they lack its values.

    Args:
        scene: Defines which signals are used, and their meaning.
        settings: Sources of the signals.

    Raises:
        SensorError: The scene requires a signal that these sources do not provide.
    """

    def __init__(self, scene: Scene, settings: SourceSettings) -> None:
        self._torque = TorqueMap.of(scene)
        self._recent = RecentCounts()
        self._trouble = RecentTrouble()
        self._checked = not settings.constant_readings
        self._arm = ArmState()
        limits = np.array([joint.torque_limit for joint in scene.robot.joints])
        self._torque_check = TorqueCheck(limits, self._recent, self._arm)
        sources = _sources(scene, settings)
        fields = ["actual_q", "actual_qd", *(() if self._torque is None else self._torque.names)]
        fields += [name for source in sources.values() for name in source.fields]
        fields += settings.extra_fields
        self._robot: RobotStream = _robot_stream(settings, list(dict.fromkeys(fields)))
        self._field_wrenches: list[FieldWrench] = []
        self._wrenches = {
            name: self._reader(scene, name, source, settings) for name, source in sources.items()
        }
        self._held = HeldPackets(max((sensor.lag for sensor in self._field_wrenches), default=0.0))
        self._period = 1.0 / settings.frequency
        self._robot_check = RobotCheck(np.array([joint.velocity_limit for joint in scene.robot.joints]))
        self._velocity_check = VelocityCheck(len(scene.robot.joints), late=0.01)
        self._seen = replace(self._robot.health)
        self._unusable = 0
        self._without_wrench = 0
        self._closed = False
        self.observer: RawObserver | None = None
        """Receives the raw data, if set."""

    def poll(self, timeout: float) -> list[Sample]:
        """Samples received, oldest first; waits up to `timeout` seconds for the first.

        Raises:
            RtdeFieldError: The robot does not know a field that the scene requires.
        """
        records = self._robot.poll(timeout)
        streams = self._streams
        for stream in streams:
            stream.poll()
        self._count_losses(records)
        for record in records:
            for stream in streams:
                stream.observe_robot(record)
        samples = []
        for record in self._complete(records):
            sample, base = self._sample(record)
            if self.observer is not None:
                self.observer.robot(record, self._robot.slices, base.raw, base.age, sample)
            if sample is not None:
                samples.append(sample)
        return samples

    def __iter__(self) -> Iterator[Sample]:
        """Samples until `close`; blocks while the robot is silent."""
        while not self._closed:
            yield from self.poll(0.1)

    @property
    def streams(self) -> int:
        """How many streams have begun: one, as a robot that is restarted is the same."""
        return 1

    @property
    def health(self) -> SourceHealth:
        """Current counters and latest problems of all sensors."""
        robot = replace(self._robot.health)
        now = time.monotonic()
        recent = self._trouble.describe(now, self._recent.totals(now), self._period)
        links = {
            name: reader.network.stream.health
            for name, reader in self._wrenches.items()
            if reader.network is not None
        }
        base = links.pop(_BASE, None)
        return SourceHealth(
            robot=robot,
            wrench=base,
            unusable=self._unusable,
            without_wrench=self._without_wrench,
            links=links,
            recent=recent,
        )

    def close(self) -> None:
        """Close the connections to all sensors."""
        self._closed = True
        self._robot.close()
        for stream in self._streams:
            stream.close()

    def __enter__(self) -> "LiveSource":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _complete(self, records: list[RobotRecord]) -> Iterator[RobotRecord]:
        """The packets for whose instants the readings in fields have arrived, with these packets."""
        for record in records:
            self._arm.at_rest = max(map(abs, record.values[self._robot.slices["actual_qd"]])) <= REST_SPEED
            for sensor in self._field_wrenches:
                sensor.take(record, self._robot.slices)
            yield from self._held.after(record)
        if not records:  # the robot is silent, rather than this process held up
            yield from self._held.overdue(time.monotonic_ns())

    @property
    def _streams(self) -> list[NetworkWrench]:
        """All sensors on the network."""
        return [reader.network for reader in self._wrenches.values() if reader.network is not None]

    def _reader(
        self, scene: Scene, name: str, source: WrenchSource, settings: SourceSettings
    ) -> WrenchReader:
        check = ReadingCheck(name, self._checked, self._recent, self._arm)
        to_base = _to_base(scene, name)
        if source.host is None:
            fields = FieldWrench(source.fields, sensor_delays(scene)[name], settings.wrench_max_age, check)
            self._field_wrenches.append(fields)
            return WrenchReader(to_base, check, fields)
        observe = self._observe_wrench if name == _BASE else lambda _: None
        network = NetworkWrench(source, _timing(scene, name, settings), check, observe)
        return WrenchReader(to_base, check, network)

    def _observe_wrench(self, readings: Sequence[WrenchRecord]) -> None:
        if self.observer is not None:
            self.observer.wrench(readings)

    def _count_losses(self, records: list[RobotRecord]) -> None:
        """Record what the robot's stream has lost or rejected since the last call."""
        now, seen, health = time.monotonic(), self._seen, self._robot.health
        if records:
            self._recent.add(now, "packets", len(records))
        lost = health.lost - seen.lost
        if 0 < lost * self._period < OUTAGE:
            self._recent.add(now, "lost", lost)
        for name in ("duplicates", "out_of_order", "bad_stamps", "jumps"):
            count = getattr(health, name) - getattr(seen, name)
            if count:
                self._recent.add(now, name, count)
        self._seen = replace(health)

    def _sample(self, record: RobotRecord) -> tuple[Sample | None, WrenchReading]:
        """The sample of a packet, if it is usable, and the base sensor's reading in it."""
        slices, values = self._robot.slices, record.values
        q = np.array(values[slices["actual_q"]])
        speeds = values[slices["actual_qd"]]
        qd = np.array(speeds)
        if not (np.isfinite(q).all() and np.isfinite(qd).all()):
            self._unusable += 1
            self._recent.add(time.monotonic(), "not finite")
            return None, _NO_READING
        if self._robot_check.velocities_impossible(qd):
            self._unusable += 1
            self._recent.add(time.monotonic(), "too fast")
            return None, _NO_READING
        torque = None
        raw: tuple[Number, ...] = ()
        if self._torque is not None:
            fields = {name: values[slices[name]] for name in self._torque.names}
            raw = tuple(number for part in fields.values() for number in part)
            torque = _finite(self._torque.torque({name: np.array(part) for name, part in fields.items()}))
            if torque is None:
                self._recent.add(time.monotonic(), "torque not finite")
        if self._checked:
            if self._frozen(record.timestamp, q, qd, raw) or self._contradicts(record.timestamp, q, qd):
                self._unusable += 1
                return None, _NO_READING
            if raw and not self._torque_check.believes(record.timestamp, raw, torque):
                torque = None
        readings = {name: reader.at(record, q) for name, reader in self._wrenches.items()}
        base = readings.pop(_BASE, _NO_READING)
        if _BASE in self._wrenches:
            self._without_wrench += base.wrench is None
        links = as_fields({name: reading.wrench for name, reading in readings.items()})
        return Sample(record.timestamp, q, qd, torque, base.wrench, **links), base

    def _frozen(self, t: float, q: np.ndarray, qd: np.ndarray, torque: tuple[Number, ...]) -> bool:
        """Whether the robot repeats an old state instead of sending the current one."""
        check = self._robot_check
        stale = check.positions_stale(t, q, qd)
        repeated = check.all_repeats(t, (*q.tolist(), *qd.tolist(), *torque)) if torque else 0.0
        if stale:
            self._recent.add(time.monotonic(), "positions frozen")
        elif repeated > REPEAT_LIMIT:
            self._recent.add(time.monotonic(), "all frozen")
        return stale or repeated > 0.0

    def _contradicts(self, t: float, q: np.ndarray, qd: np.ndarray) -> bool:
        """Whether the velocities are not those of the positions."""
        wrong = self._velocity_check.contradict(t, q, qd)
        if wrong:
            self._recent.add(time.monotonic(), "velocities wrong")
        return wrong


def _finite(array: np.ndarray) -> np.ndarray | None:
    return array if np.isfinite(array).all() else None


def _sources(scene: Scene, settings: SourceSettings) -> dict[str, WrenchSource]:
    """Where the readings of each force/torque sensor come from, by field of the scene."""
    base = {} if scene.base_wrench is None else {_BASE: _base_source(settings)}
    return base | {name: _link_source(name, settings) for name in scene.link_sensors}


def _to_base(scene: Scene, name: str) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """From joint positions and a sensor's reading to the wrench on it in base axes."""
    if name != _BASE:
        return LinkSensorFrame(scene, name).wrench
    assert scene.base_wrench is not None
    fixed = WrenchMap.of(scene.base_wrench)
    return lambda _, reading: fixed.wrench(reading)


def _timing(scene: Scene, name: str, settings: SourceSettings) -> Timing:
    """How the readings of a sensor's own box are joined with the robot's samples."""
    rate = settings.wrench_rate if name == _BASE else None
    delay = sensor_delays(scene)[name] + (settings.wrench_delay if name == _BASE else 0.0)
    # The reading of an instant comes that much later.
    return Timing(rate, settings.wrench_max_age, delay, settings.wrench_wait + max(delay, 0.0))


def _base_source(settings: SourceSettings) -> WrenchSource:
    if bool(settings.wrench_fields) == (settings.wrench_host is not None):
        got = "both" if settings.wrench_fields else "neither"
        raise SensorError(
            "the scene has a base force/torque sensor: expected either its address (wrench_host) or six RTDE "
            f"fields that carry its reading (wrench_fields), got {got}; "
            "set base_wrench: null in the scene to run without it"
        )
    if settings.wrench_host is None:
        return _with_six_numbers("wrench_fields", WrenchSource(fields=settings.wrench_fields))
    return WrenchSource(
        settings.wrench_host, settings.wrench_port, settings.wrench_http_port, settings.wrench_counts
    )


def _link_source(name: str, settings: SourceSettings) -> WrenchSource:
    """Where the readings of one of `Scene.link_sensors` come from."""
    if name == "wrist_wrench":
        return _with_six_numbers("wrist_fields", WrenchSource(fields=settings.wrist_fields))
    source = settings.link_wrenches.get(name.removeprefix("link_wrenches."), WrenchSource())
    if bool(source.fields) == (source.host is not None):
        raise SensorError(
            f"{name}: expected either the sensor's address (host) or RTDE fields that carry its reading "
            f"(fields), got {'both' if source.fields else 'neither'}"
        )
    return source if source.host is not None else _with_six_numbers(f"{name}.fields", source)


def _with_six_numbers(place: str, source: WrenchSource) -> WrenchSource:
    """The source, after a check of its fields; an unknown name is left to the robot to report."""
    known = [WIDTHS[OUTPUTS[field]] for field in source.fields if field in OUTPUTS]
    if len(known) == len(source.fields) and sum(known) != 6:
        fields = ", ".join(source.fields)
        raise SensorError(f"{place}: expected RTDE fields with 6 numbers, got {fields} with {sum(known)}")
    return source


def _robot_stream(settings: SourceSettings, fields: list[str]) -> RobotStream:
    if settings.client == "ur_rtde":
        if settings.robot_port != rtde.DEFAULT_PORT:
            raise SensorError(f"ur_rtde reads port {rtde.DEFAULT_PORT} only, got {settings.robot_port}")
        return UrRtdeStream(settings.robot_host, fields, frequency=settings.frequency)
    return RtdeStream(settings.robot_host, fields, port=settings.robot_port, frequency=settings.frequency)
