"""Settings of the sensors that a Python program gives."""

import math
from typing import Any

import numpy as np
import pytest

from contactsense.service.sensors.live_source import SourceSettings
from contactsense.service.sensors.network_wrench import WrenchSource
from contactsense.service.sensors.robot_stream import SensorError


@pytest.mark.parametrize(
    ("field", "value", "reason"),
    [
        ("client", "urrtde", "expected rtde or ur_rtde, got 'urrtde'"),
        ("robot_port", 70_000, "expected a whole number from 0 to 65535, got 70000"),
        ("wrench_port", "49152", "expected a whole number from 0 to 65535, got '49152'"),
        ("frequency", 0, "expected a number above 0, got 0"),
        ("frequency", -125.0, "expected a number above 0, got -125.0"),
        ("frequency", "500", "expected a number above 0, got '500'"),
        ("wrench_rate", math.inf, "expected a number above 0, got inf"),
        ("wrench_wait", math.nan, "expected a number of at least 0, got nan"),
        ("wrench_delay", None, "expected a finite number, got None"),
        ("wrench_counts", (1.0,), "expected two numbers above 0, counts per N and per Nm, got (1.0,)"),
        ("wrench_counts", 1e6, "expected two numbers above 0, counts per N and per Nm, got 1000000.0"),
    ],
)
def test_a_setting_that_cannot_be_used_is_named(field: str, value: Any, reason: str) -> None:
    with pytest.raises(SensorError) as refused:
        SourceSettings(robot_host="127.0.0.1", **{field: value})
    assert str(refused.value) == f"{field}: {reason}"


def test_counts_of_a_sensor_within_the_arm_are_checked_too() -> None:
    source = WrenchSource(host="127.0.0.1", counts=(1e6, 0.0))
    with pytest.raises(SensorError, match=r"link_wrenches\.forearm\.counts: expected two numbers above 0"):
        SourceSettings(robot_host="127.0.0.1", link_wrenches={"forearm": source})


def test_numbers_of_numpy_are_accepted() -> None:
    SourceSettings(robot_host="127.0.0.1", frequency=np.int64(125), wrench_rate=np.float32(1000.0))
