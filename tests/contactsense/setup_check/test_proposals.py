"""The values of lines of a scene as they are printed."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Scene
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
