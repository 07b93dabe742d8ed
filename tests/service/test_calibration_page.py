"""What the page of `contactsense calibrate` says of a result, and when it does not recommend it."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Scene, WrenchSensor
from contactsense.benchmarks.calibration.simulate import simulate
from contactsense.calibration import Settings
from contactsense.calibration import calibrate as estimate
from contactsense.calibration.motion.fourier_trajectory import FourierTrajectory
from contactsense.robots.tool import Tool
from contactsense.service.cli.calibration_doubts import doubts
from contactsense.service.cli.calibration_page import page, reasons_against
from contactsense.setup_check import check
from contactsense.setup_check.findings.unexplained import NOT_EXPLAINED


def test_a_base_sensor_that_stays_unexplained_is_not_recommended() -> None:
    """A fit cannot reverse the sign of a sensor: it turns the sensor and tilts the arm instead."""
    sensor = WrenchSensor(sign="sensor_on_arm")
    truth = Scene(robot="ur5e", joint_torque=None, base_wrench=sensor, tool=Tool(mass=1.0))
    center = np.array([0.0, -1.3, 1.5, -1.0, 0.8, 0.0])
    motion = FourierTrajectory.draw(np.random.default_rng(4), center, np.full(6, 0.7), 6, 8.0)
    recording = simulate(truth, motion, 1, 125.0)
    advice = {}
    for sign in ("sensor_on_arm", "arm_on_sensor"):
        stated = sensor.model_copy(update={"sign": sign})
        scene = truth.model_copy(update={"base_wrench": stated})
        found = estimate(scene, [recording], Settings(("wrench_bias", "tilt", "turn"), widths=False))
        advice[sign] = "\n".join(page(found, scene, Path("new.yaml"), reasons_against(found, ()))[-1].lines)
    assert "do not use" not in advice["sensor_on_arm"]
    assert re.match(
        r"do not use this scene: it does not explain .*base force z \(\d+ N\)", advice["arm_on_sensor"]
    )
    assert "`contactsense check`" in advice["arm_on_sensor"]


def test_corrections_are_told_as_the_lines_of_the_scene() -> None:
    sensor = WrenchSensor(rpy=(0.0, 0.0, 0.5236), translation=(0.0, 0.0, -0.04))
    truth = Scene(robot="ur5e", mounting="wall", joint_torque=None, base_wrench=sensor)
    off = sensor.model_copy(update={"rpy": (0.0, 0.0, 0.45), "translation": (0.0, 0.0, -0.01)})
    scene = truth.model_copy(update={"base_wrench": off})
    center = np.array([0.0, -1.3, 1.5, -1.0, 0.8, 0.0])
    motion = FourierTrajectory.draw(np.random.default_rng(4), center, np.full(6, 0.7), 6, 8.0)
    groups = Settings(("wrench_bias", "tilt", "turn", "shift"), widths=False)
    found = estimate(scene, [simulate(truth, motion, 1, 125.0)], groups)
    (changed,) = (part.lines for part in page(found, scene, None, ()) if part.title == "What changed")
    told = "\n".join(changed)
    assert re.search(r"orientation of the base sensor: rpy \[.*, 0\.52\d+\] \(was \[0, 0, 0\.45\]\)", told)
    assert re.search(
        r"place of the base sensor: translation \[.*, -0\.0(39|4)\d*\] \(was \[0, 0, -0\.01\]\)", told
    )
    # A direction of gravity that the motion does not contradict stays as it was written.
    tilts = [value for value in found.values if value.entry.group == "tilt"]
    assert tilts
    assert not any(value.changed for value in tilts)
    assert found.scene.mounting == "wall"

    def told_of(tilt: float, std: float, mounting: object) -> tuple[str, ...]:
        """What changed, if the tilt is this one."""
        others = [value for value in found.values if value not in tilts]
        values = [*others, *(replace(value, after=tilt, std=std, kept="") for value in tilts)]
        result = found.scene.model_copy(update={"mounting": mounting})
        other = replace(found, values=tuple(values), scene=result)
        (lines,) = (part.lines for part in page(other, scene, None, ()) if part.title == "What changed")
        return lines

    assert "direction of gravity" in told_of(0.0001, 0.0001, "wall")[-1]
    # On a wall, roll and yaw of a small tilt may be anything.
    line = "direction of gravity: mounting [0.2473, 1.5706, 0.2473] (was wall), tilted by 0.011 degrees"
    assert line in told_of(0.0001, 0.00001, (0.2473, 1.5706, 0.2473))


@pytest.mark.slow
def test_torques_that_check_does_not_explain_are_a_reason_against_a_calibration() -> None:
    """Those of another motion: no parameter explains them, and none is far from what it may be."""
    scene = Scene(robot="ur5e", base_wrench=None, joint_torque=JointTorqueSensor(noise=0.3))
    center = np.array([0.0, -1.3, 1.5, -1.0, 0.8, 0.0])
    motion = FourierTrajectory.draw(np.random.default_rng(4), center, np.full(6, 0.4), 6, 8.0)
    recording = simulate(scene, motion, 1, 125.0)
    assert recording.torque is not None
    reversed_in_time = replace(recording, torque=recording.torque[::-1])
    told = {}
    for part in (recording, reversed_in_time):
        found = estimate(scene, [part], Settings(("bias", "coulomb"), widths=False))
        told[part is recording] = reasons_against(found, doubts(found, scene, [part]))
        unexplained = check(found.scene, [part]).unexplained
        assert bool(unexplained) == (part is reversed_in_time)
    assert told[True] == ()
    (reason,) = told[False]
    assert reason.startswith(f"do not use this scene: {NOT_EXPLAINED}: {unexplained[0]}")
    assert "Run `contactsense check` on the scene before" in reason


def test_friction_that_is_not_estimated_is_named_with_the_reason() -> None:
    """Terms that the motion does not show were left out without a word, except by --verbose."""
    scene = Scene(robot="ur5e", base_wrench=None, joint_torque=JointTorqueSensor(noise=0.3))
    center = np.array([0.0, -1.3, 1.5, -1.0, 0.8, 0.0])
    motion = FourierTrajectory.draw(np.random.default_rng(4), center, np.full(6, 0.4), 6, 8.0)
    groups = Settings(("coulomb", "load", "lubricant"), widths=False)
    found = estimate(scene, [simulate(scene, motion, 1, 125.0)], groups)

    def told(kept: dict[str, str]) -> list[str]:
        values = [replace(value, kept=kept.get(value.entry.name, "")) for value in found.values]
        sections = page(replace(found, values=tuple(values)), scene, None, ())
        (lines,) = (part.lines for part in sections if part.title == "What changed")
        return [line for line in lines if "not estimated" in line]

    joints = [joint.name for joint in scene.robot.joints]
    small = {f"load of {name}": "not significant in the data: kept" for name in joints}
    negative = {f"lubricant of {joints[i]}": f"came out negative (-{i} +- 1 Nm): kept" for i in (1, 2)}
    assert told({}) == []
    assert told(small | negative) == [
        "load-dependent friction is not estimated, but kept as in the scene: not significant in the data "
        "(all joints)",
        "lubricant friction is not estimated, but kept as in the scene: came out negative "
        "(shoulder_lift_joint, elbow_joint)",
    ]
