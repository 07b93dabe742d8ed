"""The values of lines of a scene as they are printed."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Scene, WrenchSensor
from contactsense.robots.tool import Tool
from contactsense.setup_check.lines import TORQUE_SIGNAL
from contactsense.setup_check.proposals import line_value
from contactsense.setup_check.setup import Setup
from tests.plain_arm import plain_ur5e


@pytest.mark.parametrize("signal", ["actual_current", "actual_current_as_torque"])
def test_torques_that_are_all_frozen_leave_their_signal_as_it_is(
    signal: Literal["actual_current", "actual_current_as_torque"],
) -> None:
    scene = Scene(robot=plain_ur5e(), joint_torque=JointTorqueSensor(signal=signal))
    frozen = replace(Setup.of(scene), gain=np.zeros(6))
    assert line_value(TORQUE_SIGNAL, frozen, scene) == (signal, "")


@pytest.mark.parametrize("signal", ["actual_current", "actual_current_as_torque"])
def test_with_torque_constants_of_one_the_signal_is_the_stated_one(
    signal: Literal["actual_current", "actual_current_as_torque"],
) -> None:
    sensor = JointTorqueSensor(signal=signal, torque_constants=(1.0,) * 6)
    scene = Scene(robot=plain_ur5e(), joint_torque=sensor)
    assert line_value(TORQUE_SIGNAL, Setup.of(scene), scene) == (signal, "")


@pytest.mark.parametrize(
    ("noise", "text"),
    [
        ((0.25, 0.05), "[1.23, 0, -0.02, 0.01, -0.05, 0]"),
        ((0.02, 0.0005), "[1.23, 0, -0.02, 0.0064, -0.051, 0.003]"),
        ((0.0002, 0.05), "[1.2346, 0.0041, -0.0234, 0.01, -0.05, 0]"),
    ],
)
def test_a_bias_is_written_as_finely_as_the_sensor_measures(noise: tuple[float, float], text: str) -> None:
    """What is off by more than the noise must not be written as the value that the scene has."""
    bias = (1.23456, 0.00414, -0.0234, 0.00642, -0.05104, 0.003)
    sensor = WrenchSensor(force_noise=noise[0], moment_noise=noise[1], bias=bias)
    scene = Scene(robot=plain_ur5e(), tool=Tool(mass=1.0), wrist_wrench=sensor)
    assert line_value("wrist_wrench.bias", Setup.of(scene), scene) == (text, "")


@pytest.mark.parametrize("field", ["base_wrench", "wrist_wrench"])
def test_the_orientation_of_a_sensor_is_written_as_in_the_scene(field: str) -> None:
    """Other angles say the same: those below were shown as [-1.1416, 1.1416, 3.1416]."""
    sensors = {field: WrenchSensor(rpy=(2.0, 2.0, 0.0))}
    scene = Scene(robot=plain_ur5e(), tool=Tool(mass=1.0), **sensors)
    assert line_value(f"{field}.rpy", Setup.of(scene), scene) == ("[2, 2, 0]", "")
