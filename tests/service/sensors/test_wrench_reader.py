"""Readings in the robot's packets that cannot be measurements: told by field, left out, used again.

Base sensor, wrist sensor and a sensor between links are read alike.
"""

from dataclasses import dataclass

import numpy as np
import pytest

from contactsense import Localizer, Sample, Scene
from contactsense.robots.tool import Tool
from contactsense.scene import LinkWrenchSensor, WrenchSensor
from contactsense.scene_model.link_sensor_frame import LinkSensorFrame
from contactsense.service.mock.servers import MockServers, MockSettings
from contactsense.service.sensors.live_source import LiveSource
from contactsense.service.sensors.network_wrench import WrenchSource
from contactsense.service.sensors.source_settings import SourceSettings
from tests.contactsense.link_sensors.truth import ARM, BASE, SENSOR, STEP, TORQUE, stream
from tests.service.loopback import SmallFeed, until, waiting_clock
from tests.service.sensors.mock_source import start_when_connected

MOCK = MockSettings(rtde_port=0, netft_port=0, http_port=0)
REGISTERS = tuple(f"output_double_register_{i}" for i in range(12))
RATE = 500
FAULTS = {"base_wrench": (200, 300), "wrist_wrench": (350, 450), "link_wrenches.elbow": (500, 600)}
"""First row of each sensor's fault, and the first one after it."""
MAX_AGE = 0.005


def faulty(readings: np.ndarray, rows: tuple[int, int], kind: str) -> np.ndarray:
    changed = readings.copy()
    changed[slice(*rows)] = {"frozen": readings[rows[0]], "zero": 0.0, "NaN": np.nan}[kind]
    return changed


def registers(first: int, readings: np.ndarray) -> dict[str, np.ndarray]:
    return {REGISTERS[first + i]: readings[:, i] for i in range(6)}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "reason"),
    [("frozen", "repeats the same reading"), ("zero", "exactly zero"), ("NaN", "not numbers")],
)
def test_a_faulty_sensor_is_told_by_its_field_and_recovers(kind: str, reason: str) -> None:
    scene = Scene(
        robot="ur5e",
        wrist_wrench=WrenchSensor(),
        link_wrenches=[LinkWrenchSensor(name="elbow", link="forearm")],
        tool=Tool(mass=1.0),
    )
    readings = 0.01 * np.arange(5000)[:, None] + np.arange(1, 7)
    base, wrist, elbow = (faulty(readings, rows, kind) for rows in FAULTS.values())
    fields = registers(0, base) | registers(6, elbow) | {"ft_raw_wrench": wrist}
    told: dict[str, float] = {}
    samples: list[Sample] = []
    with MockServers(SmallFeed(), MOCK, fields=fields, clock=waiting_clock()) as servers:
        settings = SourceSettings(
            servers.rtde.host,
            servers.rtde.port,
            wrench_fields=REGISTERS[:6],
            link_wrenches={"elbow": WrenchSource(fields=REGISTERS[6:])},
        )
        with LiveSource(scene, settings) as source:

            def past(t: float) -> bool:
                samples.extend(source.poll(0.01))
                for part in source.health.trouble.split("; "):
                    field, _, text = part.partition(": ")
                    if reason in text:
                        told.setdefault(field, samples[-1].t)
                return bool(samples) and samples[-1].t > t

            start_when_connected(servers, source)
            assert until(lambda: past(650 / RATE))
            assert until(lambda: past(0.0) and source.health.trouble == "")
    assert set(told) == set(FAULTS)
    for field, (first, end) in FAULTS.items():
        assert first / RATE < told[field] < first / RATE + 1.0
        arrived = min(row for sample in samples if (row := round(sample.t * RATE)) >= first)
        trusted = arrived + MAX_AGE * RATE if kind == "frozen" else first - 1
        for sample in samples:
            row = round(sample.t * RATE)
            values = {"base_wrench": sample.base_wrench, "wrist_wrench": sample.wrist_wrench}
            there = (values | {"link_wrenches.elbow": (sample.link_wrenches or {}).get("elbow")})[field]
            # The first of a row of equal readings that arrives is a measurement, and is used for a while.
            if trusted < row < end:
                assert there is None, (field, row)
            elif not first <= row <= trusted:
                assert there is not None, (field, row)


@dataclass(frozen=True)
class Recorded:
    """Samples as a motion that the mock plays."""

    samples: list[Sample]
    rate: float = 1.0 / STEP

    def __getattr__(self, name: str) -> np.ndarray:
        return np.array([getattr(sample, name) for sample in self.samples])


def played(scene: Scene, feed: Recorded, readings: np.ndarray, checked: bool) -> list[Sample]:
    samples: list[Sample] = []
    base = registers(0, feed.base_wrench)
    fields = base | registers(6, readings)
    with MockServers(feed, MOCK, fields=fields, clock=waiting_clock()) as servers:
        settings = SourceSettings(
            servers.rtde.host,
            servers.rtde.port,
            wrench_fields=REGISTERS[:6],
            link_wrenches={"forearm": WrenchSource(fields=REGISTERS[6:])},
            constant_readings=not checked,
        )
        with LiveSource(scene, settings) as source:
            last = feed.samples[-2].t
            start_when_connected(servers, source)
            assert until(lambda: samples.extend(source.poll(0.1)) or samples[-1].t >= last)
    return samples


@pytest.mark.slow
def test_a_frozen_sensor_within_a_moving_arm_is_no_contact() -> None:
    scene = Scene(robot=ARM, base_wrench=BASE, joint_torque=TORQUE, link_wrenches=(SENSOR,))
    feed = Recorded(stream(scene, 1.6, seed=5))
    exact = np.array([(sample.link_wrenches or {})["forearm"] for sample in feed.samples])
    frame = LinkSensorFrame(scene, "link_wrenches.forearm")
    readings = faulty(frame.readings(feed.q, exact), (300, 600), "frozen")
    localizer = Localizer(scene)
    found = list(localizer.run(played(scene, feed, readings, checked=True)))
    assert not any(estimate.contacts for estimate in found)
    silent = [estimate for estimate in found if 0.7 < estimate.t < 1.2]
    assert {estimate.reason for estimate in silent} == {"link_wrenches.forearm is missing"}
    assert found[-1].status == "none"
    # Without the check, the frozen reading is taken for a contact.
    localizer.reset()
    believed = list(localizer.run(played(scene, feed, readings, checked=False)))
    assert any(estimate.contacts for estimate in believed)
