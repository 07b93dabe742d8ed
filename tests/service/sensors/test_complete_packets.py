"""Packets on their way through a live source, of a robot that a test scripts."""

import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from contactsense.scene import Scene
from contactsense.service.sensors.checks.plausibility import RecentCounts
from contactsense.service.sensors.clients.robot_stream import RobotRecord, StreamHealth
from contactsense.service.sensors.held_packets import HeldPackets
from contactsense.service.sensors.live_source import LiveSource, SourceSettings


@pytest.fixture
def source() -> Iterator[LiveSource]:
    with LiveSource(Scene(robot="ur5e", base_wrench=None), SourceSettings("192.0.2.1")) as made:
        robot: Any = SimpleNamespace(
            slices={"actual_qd": slice(0, 6)}, close=made._robot.close, health=StreamHealth()
        )
        made._robot = robot
        yield made


def packet(*speeds: float) -> RobotRecord:
    return RobotRecord(0.0, 0, speeds)


@pytest.mark.parametrize(
    ("speeds", "at_rest"),
    [((0.0,) * 6, True), ((0.0, 0.0, 0.1, 0.0, 0.0, 0.0), False), ((-0.1, *5 * (0.0,)), False)],
)
def test_an_arm_with_one_joint_that_turns_is_not_at_rest(
    source: LiveSource, speeds: tuple[float, ...], at_rest: bool
) -> None:
    """Only at rest may readings repeat."""
    assert list(source._complete([packet(*speeds)])) == [packet(*speeds)]
    assert source._arm.at_rest == at_rest


def test_a_packet_that_waits_for_readings_is_let_go_where_the_robot_is_silent(source: LiveSource) -> None:
    """Not because this process was held up: then the packets that end its wait are there already."""
    source._held = HeldPackets(0.01)
    late = packet(*6 * [0.0])  # it arrived long ago
    assert list(source._complete([late])) == []
    assert list(source._complete([])) == [late]


def test_packets_and_what_is_wrong_with_them_are_counted(source: LiveSource) -> None:
    """But not as lost what is missing after an outage, which the state reports: 0.5 s are 250 packets."""
    source._recent = RecentCounts(window=1e6)
    health = source._robot.health
    for packets, lost, duplicates in ((40, 0, 0), (0, 10, 2), (60, 249, 0), (30, 250, 1), (20, 1, 0)):
        health.lost += lost
        health.duplicates += duplicates
        source._count_losses([packet()] * packets)
    assert source._recent.totals(time.monotonic()) == {"packets": 150, "lost": 260, "duplicates": 3}
