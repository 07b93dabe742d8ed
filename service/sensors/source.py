"""Live samples: the robot's stream and the force/torque sensor's, joined per instant."""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from contactsense.scene import Scene
from contactsense.types import Sample
from service.sensors import netft, rtde
from service.sensors.align import Aligned, Aligner
from service.sensors.mapping import TorqueMap, WrenchMap, WristMap
from service.sensors.netft import NetFtStream, WrenchHealth, WrenchRecord
from service.sensors.rtde import RtdeStream
from service.sensors.streams import NS, RobotRecord, RobotStream, SensorError, StreamHealth
from service.sensors.ur_rtde_source import UrRtdeStream
from service.wire.rtde_fields import OUTPUTS, WIDTHS

_ALIVE = 0.05
"""A force/torque sensor silent for longer than this is not waited for [s]."""


@dataclass(frozen=True, slots=True)
class SourceSettings:
    """Where the sensors are and how they are read."""

    robot_host: str
    robot_port: int = rtde.DEFAULT_PORT
    client: Literal["rtde", "ur_rtde"] = "rtde"
    """`rtde`: our own reader, loses nothing; `ur_rtde`: in a process of its own, always port 30004."""
    frequency: float = 500.0
    """Robot samples a second [Hz]: 500 for e-Series, 125 for CB3."""
    wrench_host: str | None = None
    """Address of the Net F/T sensor under the base; None: there is none on the network."""
    wrench_port: int = netft.DEFAULT_PORT
    wrench_http_port: int = netft.DEFAULT_HTTP_PORT
    wrench_counts: tuple[float, float] | None = None
    """Counts per newton and newton metre; None: ask the sensor's web server."""
    wrench_fields: tuple[str, ...] = ()
    """Six RTDE fields that carry the base sensor's reading [N, Nm], such as output registers, instead of
    `wrench_host`."""
    wrist_fields: tuple[str, ...] = ("ft_raw_wrench",)
    """RTDE fields that carry the wrist sensor's six numbers [N, Nm], where the scene has one."""
    wrench_rate: float | None = None
    """How many readings a second the sensor numbers [Hz]; None: learn it from their arrivals, which takes a
    moment, the longer the busier the host."""
    wrench_delay: float = 0.0
    """By how much a force/torque reading is always longer on its way than a robot packet [s]."""
    wrench_max_age: float = 0.01
    """An older force/torque reading is no reading [s]."""
    wrench_wait: float = 0.003
    """How long a robot sample may wait for the force/torque reading of its instant [s]."""


@dataclass(frozen=True, slots=True)
class SourceHealth:
    """How the sensors are doing."""

    robot: StreamHealth
    wrench: WrenchHealth | None
    """None where the force/torque values come with the robot's packets, or there is no such sensor."""
    unusable: int
    """Robot records without finite joint positions and velocities; not delivered."""
    without_wrench: int
    """Samples delivered without the base wrench that the scene asks for: sensor silent, or no number."""
    wrench_age: float
    """How much older than the latest sample its force/torque value was [s]; infinite where there was none."""

    @property
    def trouble(self) -> str:
        """What is wrong at this moment, one line for a person; empty if all is well."""
        found = []
        if self.robot.state != "streaming":
            found.append(self.robot.error or "no data from the robot yet")
        if self.wrench is not None and self.wrench.state != "streaming":
            found.append(self.wrench.error or "no data from the force/torque sensor yet")
        return "; ".join(found)


class LiveSource:
    """Samples for ever. Sensors may come and go: without the robot none come, without the other they lack it.

    Args:
        scene: Which signals are used and what they mean.
        settings: Where they come from.

    Raises:
        SensorError: The scene asks for a signal that cannot be had this way.
    """

    def __init__(self, scene: Scene, settings: SourceSettings) -> None:
        self._torque = TorqueMap.of(scene)
        self._wrench_fields = settings.wrench_fields
        fields = ["actual_q", "actual_qd"]
        if self._torque is not None:
            fields += self._torque.names
        self._wrench_map: WrenchMap | None = None
        if scene.base_wrench is not None:
            self._wrench_map = WrenchMap.of(scene.base_wrench)
            fields += _wrench_fields(settings)
        self._wrist: WristMap | None = None
        self._wrist_fields = settings.wrist_fields
        if scene.wrist_wrench is not None:
            self._wrist = WristMap(scene.wrist_wrench, scene.robot)
            fields += _wrist_fields(settings)
        self._robot: RobotStream = _robot_stream(settings, fields)
        self._sensor: NetFtStream | None = None
        if self._wrench_map is not None and settings.wrench_host is not None:
            self._sensor = NetFtStream(
                settings.wrench_host,
                port=settings.wrench_port,
                http_port=settings.wrench_http_port,
                counts=settings.wrench_counts,
            )
        self._aligner = Aligner(
            period=None if settings.wrench_rate is None else 1.0 / settings.wrench_rate,
            max_age=settings.wrench_max_age,
            delay=settings.wrench_delay + (scene.base_wrench.delay if scene.base_wrench is not None else 0.0),
        )
        self._wait = settings.wrench_wait
        self._heard_ns = 0
        self._unusable = 0
        self._without_wrench = 0
        self._age = math.inf
        self._closed = False

    def poll(self, timeout: float) -> list[Sample]:
        """Samples that have come, oldest first; waits up to `timeout` seconds for the first.

        Raises:
            RtdeFieldError: The robot does not know a field that the scene asks for.
        """
        records = self._robot.poll(timeout)
        if self._sensor is not None:
            self._hear(self._sensor.poll())
        samples = []
        for record in records:
            self._aligner.observe_robot(record.timestamp, record.arrival_ns)
        for record in records:
            sample = self._sample(record)
            if sample is not None:
                samples.append(sample)
        return samples

    def __iter__(self) -> Iterator[Sample]:
        """Samples until `close`; blocks while the robot is silent."""
        while not self._closed:
            yield from self.poll(0.1)

    @property
    def health(self) -> SourceHealth:
        """Counters and the latest troubles of all sensors, as they are now."""
        wrench = None if self._sensor is None else self._sensor.health
        robot = replace(self._robot.health)
        return SourceHealth(robot, wrench, self._unusable, self._without_wrench, self._age)

    def close(self) -> None:
        """Let go of all sensors."""
        self._closed = True
        self._robot.close()
        if self._sensor is not None:
            self._sensor.close()

    def __enter__(self) -> "LiveSource":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _hear(self, readings: list[WrenchRecord]) -> None:
        for reading in readings:
            self._aligner.add(*reading)
        if readings:
            self._heard_ns = readings[-1].arrival_ns

    def _sample(self, record: RobotRecord) -> Sample | None:
        slices, values = self._robot.slices, record.values
        q = np.array(values[slices["actual_q"]])
        qd = np.array(values[slices["actual_qd"]])
        if not (np.isfinite(q).all() and np.isfinite(qd).all()):
            self._unusable += 1
            return None
        torque = None
        if self._torque is not None:
            torque = _finite(
                self._torque.torque({name: np.array(values[slices[name]]) for name in self._torque.names})
            )
        wrench = None
        if self._wrench_map is not None:
            reading = self._reading(record)
            self._age = reading.age
            wrench = None if reading.wrench is None else _finite(self._wrench_map.wrench(reading.wrench))
            self._without_wrench += wrench is None
        wrist = None
        if self._wrist is not None:
            read = np.concatenate([values[slices[name]] for name in self._wrist_fields])
            wrist = _finite(self._wrist.wrench(q, read))
        return Sample(record.timestamp, q, qd, torque, wrench, wrist)

    def _reading(self, record: RobotRecord) -> Aligned:
        if self._sensor is None:
            slices = self._robot.slices
            return Aligned(np.array([record.values[slices[name].start] for name in self._wrench_fields]), 0.0)
        deadline = record.arrival_ns + int(self._wait * NS)
        while not self._aligner.covers(record.timestamp):
            now = time.monotonic_ns()
            if now >= deadline or now - self._heard_ns > _ALIVE * NS:
                break
            self._hear(self._sensor.poll((deadline - now) / NS))
        return self._aligner.at(record.timestamp)


def _finite(array: np.ndarray) -> np.ndarray | None:
    return array if np.isfinite(array).all() else None


def _wrench_fields(settings: SourceSettings) -> tuple[str, ...]:
    if bool(settings.wrench_fields) == (settings.wrench_host is not None):
        got = "both" if settings.wrench_fields else "neither"
        raise SensorError(
            "the scene has a base force/torque sensor: expected either its address (wrench_host) or six RTDE "
            f"fields that carry its reading (wrench_fields), got {got}; "
            "base_wrench: null in the scene does without"
        )
    if settings.wrench_fields and len(settings.wrench_fields) != 6:
        raise SensorError(f"wrench_fields: expected 6 RTDE fields, got {len(settings.wrench_fields)}")
    return settings.wrench_fields


def _wrist_fields(settings: SourceSettings) -> tuple[str, ...]:
    names = settings.wrist_fields
    # A name that nobody knows is the robot's to complain about.
    numbers = sum(WIDTHS[OUTPUTS[name]] for name in names if name in OUTPUTS)
    if numbers != 6 and all(name in OUTPUTS for name in names):
        raise SensorError(
            f"wrist_fields: expected RTDE fields with 6 numbers, got {', '.join(names)} with {numbers}"
        )
    return names


def _robot_stream(settings: SourceSettings, fields: list[str]) -> RobotStream:
    if settings.client == "ur_rtde":
        if settings.robot_port != rtde.DEFAULT_PORT:
            raise SensorError(f"ur_rtde reads port {rtde.DEFAULT_PORT} only, got {settings.robot_port}")
        return UrRtdeStream(settings.robot_host, fields, frequency=settings.frequency)
    return RtdeStream(settings.robot_host, fields, port=settings.robot_port, frequency=settings.frequency)
