"""Settings of the sensors that a Python program gives."""

import math
from typing import Any

import numpy as np
import pytest

from contactsense.service.sensors.clients.robot_stream import SensorError
from contactsense.service.sensors.network_wrench import WrenchSource
from contactsense.service.sensors.source_settings import SourceSettings


@pytest.mark.parametrize(
    ("field", "value", "reason"),
    [
        ("client", "urrtde", "expected rtde or ur_rtde, got 'urrtde'"),
        ("robot_port", 70_000, "expected a whole number from 0 to 65535, got 70000"),
        ("wrench_port", "49152", "expected a whole number from 0 to 65535, got '49152'"),
        ("robot_port", True, "expected a whole number from 0 to 65535, got True"),
        ("frequency", 0, "expected a number above 0, got 0"),
        ("frequency", True, "expected a number above 0, got True"),
        ("frequency", -125.0, "expected a number above 0, got -125.0"),
        ("frequency", "500", "expected a number above 0, got '500'"),
        ("wrench_max_age", np.True_, "expected a number above 0, got np.True_"),
        ("wrench_rate", True, "expected a number above 0, got True"),
        ("wrench_rate", math.inf, "expected a number above 0, got inf"),
        ("wrench_wait", math.nan, "expected a number of at least 0, got nan"),
        ("wrench_wait", False, "expected a number of at least 0, got False"),
        ("wrench_delay", False, "expected a finite number, got False"),
        ("wrench_delay", None, "expected a finite number, got None"),
        ("wrench_counts", (1.0,), "expected two numbers above 0, counts per N and per Nm, got (1.0,)"),
        (
            "wrench_counts",
            (1e6, True),
            "expected two numbers above 0, counts per N and per Nm, got (1000000.0, True)",
        ),
        ("wrench_counts", 1e6, "expected two numbers above 0, counts per N and per Nm, got 1000000.0"),
    ],
)
def test_a_setting_that_cannot_be_used_is_named(field: str, value: Any, reason: str) -> None:
    with pytest.raises(SensorError) as refused:
        SourceSettings(robot_host="127.0.0.1", **{field: value})
    assert str(refused.value) == f"{field}: {reason}"


@pytest.mark.parametrize(
    ("field", "value", "reason"),
    [
        ("counts", (1e6, 0.0), "expected two numbers above 0"),
        ("port", 70_000, "expected a whole number from 0 to 65535, got 70000"),
        ("http_port", True, "expected a whole number from 0 to 65535, got True"),
    ],
)
def test_numbers_of_a_sensor_within_the_arm_are_checked_too(field: str, value: Any, reason: str) -> None:
    source = WrenchSource(host="127.0.0.1", **{field: value})
    with pytest.raises(SensorError, match=rf"^link_wrenches\.forearm\.{field}: {reason}"):
        SourceSettings(robot_host="127.0.0.1", link_wrenches={"forearm": source})


def test_numbers_of_numpy_are_accepted() -> None:
    SourceSettings(robot_host="127.0.0.1", frequency=np.int64(125), wrench_rate=np.float32(1000.0))
