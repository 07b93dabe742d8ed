"""Readings in fields of the robot's packets, at the instants to which they belong."""

import math

import numpy as np
import pytest

from contactsense.service.sensors.checks.plausibility import ReadingCheck, RecentCounts
from contactsense.service.sensors.checks.stuck_channels import ArmState
from contactsense.service.sensors.clients.robot_stream import RobotRecord
from contactsense.service.sensors.field_wrench import FieldWrench

SLICES = {"force": slice(0, 3), "moment": slice(3, 6)}


def sensor(delay: float) -> FieldWrench:
    check = ReadingCheck("base_wrench", False, RecentCounts(), ArmState())
    return FieldWrench(("force", "moment"), delay, 0.005, check)


def packet(t: float, late: float = 0.0) -> RobotRecord:
    """One whose reading is that of `late` before: each component is the instant and its number."""
    return RobotRecord(t, 0, tuple((t - late + np.arange(6)).tolist()))


@pytest.mark.parametrize("delay", [0.0, 0.0013, 0.05, -0.0013, -0.05])
def test_the_delay_is_taken_off(delay: float) -> None:
    source = sensor(delay)
    ahead = math.ceil(source.lag / 0.002)
    for k in range(200):
        source.take(packet(0.002 * k, delay), SLICES)
        asked = 0.002 * (k - ahead)
        if asked >= 0.06:
            found = source.at(packet(asked))
            np.testing.assert_allclose(found.wrench, asked + np.arange(6), atol=1e-12)
            assert found.age == 0.0
    assert len(source._readings) < 150  # of the 200: old ones are not kept


def test_what_has_not_come_is_no_reading() -> None:
    source = sensor(0.01)
    for k in range(20):
        source.take(packet(0.002 * k), SLICES)
    assert source.at(packet(0.028)).wrench is not None
    assert source.at(packet(0.0285)).wrench is None
    assert source.at(packet(-0.02)).wrench is None


def test_readings_are_not_interpolated_over_a_gap_or_a_clock_that_is_set_back() -> None:
    source = sensor(0.001)
    source.take(packet(1.0), SLICES)
    source.take(packet(1.03), SLICES)
    assert source.at(packet(1.01)).wrench is None
    source.take(packet(0.5), SLICES)
    assert source.at(packet(1.0)).wrench is None
    source.take(packet(0.502), SLICES)
    np.testing.assert_allclose(source.at(packet(0.5)).wrench, 0.501 + np.arange(6))


def test_what_is_left_out_is_no_reading_of_its_neighbours() -> None:
    source = sensor(0.0)
    source.take(packet(0.0), SLICES)
    source.take(RobotRecord(0.002, 0, (math.nan,) * 6), SLICES)
    assert source.at(packet(0.0)).wrench is not None
    assert source.at(packet(0.002)).wrench is None
