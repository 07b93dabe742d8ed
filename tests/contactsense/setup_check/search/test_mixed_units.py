"""Positions and velocities of some joints in degrees, those of others in rad."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import Scene
from contactsense.benchmarks.calibration.setup_draws import Settings, right_setup
from contactsense.calibration.free_motion import FreeMotion
from contactsense.setup_check.fit.fitter import Fitter
from contactsense.setup_check.search.mixed_units import check_units
from contactsense.setup_check.setup import Setup
from contactsense.setup_check.terms.motion_basis import MotionBases, Readings
from contactsense.setup_check.usable_recordings import CheckError


def look_at_units(scene: Scene, recording: FreeMotion, degrees: tuple[int, ...]) -> None:
    """As the check does, with these joints in degrees."""
    unit = np.ones(6)
    unit[list(degrees)] = 180.0 / np.pi
    parts = [replace(recording, q=unit * recording.q, qd=unit * recording.qd)]
    readings = Readings.of(scene, parts)
    fitter = Fitter(scene, MotionBases({scene.robot.name: scene}, parts), readings)
    check_units(scene, parts, readings, fitter, Setup.of(scene))


@pytest.mark.parametrize("with_base_sensor", [True, False])
@pytest.mark.parametrize("degrees", [(1,), (5,), (0, 1, 2, 3, 4)])
def test_two_units_are_named(degrees: tuple[int, ...], with_base_sensor: bool) -> None:
    """The check named exchanged joints or another tool, as the velocities agree."""
    case = right_setup("ur5e", 1, Settings())
    scene, recording = case.scene, case.recording
    if not with_base_sensor:
        scene = scene.model_copy(update={"base_wrench": None})
        recording = recording.with_readings({})
    names = [joint.name for joint in scene.robot.joints]
    told = [
        ", ".join(names[j] for j in range(6) if (j in degrees) == is_degrees) for is_degrees in (True, False)
    ]
    with pytest.raises(
        CheckError, match=f"q: .* got degrees for {told[0]} and rad for {told[1]}, by the arm's"
    ):
        look_at_units(scene, recording, degrees)


def test_a_joint_that_stays_near_zero_in_degrees_is_not_in_rad() -> None:
    case = right_setup("ur5e", 1, Settings(speed=0.03))
    scene = case.scene.model_copy(update={"base_wrench": None})
    recording = case.recording.with_readings({})
    # Without a base sensor, the zero of the first joint of an arm on a table is no matter.
    q = recording.q - np.array([recording.q[:, 0].mean(), 0.0, 0.0, 0.0, 0.0, 0.0])
    assert np.degrees(np.abs(q[:, 0])).max() < 2.0 * np.pi
    scene = scene.model_copy(update={"mounting": "table"})
    look_at_units(scene, replace(recording, q=q), tuple(range(6)))


def test_right_units_and_degrees_throughout_are_left_to_the_check() -> None:
    case = right_setup("ur10e", 2, Settings())
    for degrees in ((), tuple(range(6))):
        look_at_units(case.scene, case.recording, degrees)
