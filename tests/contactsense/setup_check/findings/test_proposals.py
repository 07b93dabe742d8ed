"""The values of lines of a scene as they are printed."""

from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from contactsense import JointTorqueSensor, Scene, WrenchSensor
from contactsense.robots.tool import Tool
from contactsense.setup_check.findings.proposals import line_value
from contactsense.setup_check.hypotheses.all_hypotheses import Hypotheses, other_signal
from contactsense.setup_check.lines import (
    ANGLE_ORDER,
    ANGLE_UNIT,
    DELAYED_TORQUES,
    FROZEN_TORQUES,
    GRAVITY,
    MOUNTING,
    ROBOT,
    TOOL,
    TOOL_COM,
    TOOL_MASS,
    TORQUE_ORDER,
    TORQUE_SIGN,
    TORQUE_SIGNAL,
    ZEROS,
)
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


@pytest.mark.parametrize("constant", [0.5, 12.0])
@pytest.mark.parametrize(
    ("signal", "text", "remark"),
    [
        ("actual_current", "actual_current_as_torque", "the values are torques [Nm]"),
        ("actual_current_as_torque", "actual_current", "the values are currents [A]"),
    ],
)
def test_the_signal_that_is_meant_is_the_other_one(
    signal: Literal["actual_current", "actual_current_as_torque"], text: str, remark: str, constant: float
) -> None:
    """Whether a current in ampere is more or less than its torque in newton metres."""
    arm = plain_ur5e()
    joints = tuple(replace(joint, torque_constant=constant) for joint in arm.joints)
    scene = Scene(robot=replace(arm, joints=joints), joint_torque=JointTorqueSensor(signal=signal))
    meant = replace(Setup.of(scene), gain=other_signal(scene))
    assert line_value(TORQUE_SIGNAL, meant, scene) == (text, remark)
    found = Hypotheses(scene, {}, 1.0, True, (), np.ones(6, dtype=bool)).of(Setup.of(scene))
    (start,) = next(hypothesis for hypothesis in found if hypothesis.line == TORQUE_SIGNAL).starts
    assert start[0] == remark
    np.testing.assert_array_equal(start[1].gain, other_signal(scene))


@pytest.mark.parametrize(
    ("stated", "meant", "text", "remark"),
    [
        ((0.4, 0.0, 0.3), (-0.4, 0.0, 0.0), "[-0.4, 0, 0.3]", "opposite sign"),
        ((0.4, 0.2, 0.3), (0.4, -0.2, 0.0), "[0.4, -0.2, 0.3]", "opposite sign"),
        ((5.0, 0.0, 0.3), (np.radians(5.0), 0.0, 0.0), "[0.0873, 0, 0.0052]", "given in degrees"),
        ((0.4, 0.0, 0.3), (1.0, 0.0, 0.0), "[1, 0, 0.3]", ""),
        ((0.4, 0.0, 0.3), (0.4, 0.0, 2.0), "[0.4, 0, 0.3]", ""),  # of the yaw gravity says nothing
    ],
)
def test_a_mounting_that_is_meant(
    stated: tuple[float, float, float], meant: tuple[float, float, float], text: str, remark: str
) -> None:
    scene = Scene(robot=plain_ur5e(), mounting=stated)
    gravity = 9.81 * Rotation.from_euler("xyz", meant).inv().apply([0.0, 0.0, -1.0])
    found = line_value(MOUNTING, replace(Setup.of(scene), gravity=gravity), scene)
    assert found == (text, remark)


def test_a_load_on_a_link_is_told_with_the_inertia_of_the_link() -> None:
    arm = plain_ur5e()
    scene, own = Scene(robot=arm), arm.links[2].inertia
    line = f"inertia.{arm.link_names[2]}"
    plain, remark = line_value(line, Setup.of(scene), scene)
    assert plain.startswith(f"{{mass: {own.mass:.3g}, com: [")
    assert remark == ""
    setup = Setup.of(scene)
    loads, places = setup.loads.copy(), setup.places.copy()
    loads[2], places[2] = 1.5, (0.1, 0.0, -0.05)
    loaded, remark = line_value(line, replace(setup, loads=loads, places=places), scene)
    assert loaded.startswith(f"{{mass: {own.mass + 1.5:.3g}, com: [")
    assert remark.startswith("a load of about 1.5 kg at [0.1, 0, -0.05] m in the link's frame")


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


ARM = plain_ur5e()
CELL = Scene(robot=ARM, tool=Tool(name="tool", mass=1.5, com=(0.0, 0.02, 0.06)))
SENSOR = Setup.of(CELL).sensors["base_wrench"]
READ = np.eye(6)
"""How the values of a force/torque sensor come: as they are."""


def _turned(x: float, y: float, z: float) -> np.ndarray:
    """Gravity in a direction [m/s^2]."""
    return 9.81 * np.array([x, y, z]) / np.linalg.norm([x, y, z])


@pytest.mark.parametrize(
    ("line", "change", "text", "remark"),
    [
        (ROBOT, {"robot": "ur3e"}, "ur3e", ""),
        (ANGLE_UNIT, {}, "rad", ""),
        (ANGLE_UNIT, {"angle_unit": np.pi / 180.0}, "deg", "they are in degrees"),
        (ANGLE_UNIT, {"angle_unit": 180.0 / np.pi}, "rad", "converted twice"),
        (MOUNTING, {}, "table", ""),
        (MOUNTING, {"gravity": _turned(0.02, 0.0, 1.0)}, "ceiling", ""),
        (MOUNTING, {"gravity": _turned(1.0, 0.0, 0.0)}, "wall", ""),
        # Gravity along -z of a base that is rolled by 0.1 rad and pitched by -0.2 rad.
        (
            MOUNTING,
            {"gravity": _turned(np.sin(-0.2), -np.sin(0.1) * np.cos(0.2), -np.cos(0.1) * np.cos(0.2))},
            "[0.1, -0.2, 0]",
            "",
        ),
        (GRAVITY, {"gravity": np.array([0.0, 0.0, -1.625])}, "1.625", ""),
        (TOOL_MASS, {"mass": 2.3456}, "2.35", ""),
        (TOOL_COM, {"com": np.array([0.0, -0.0304, 0.1])}, "[0, -0.03, 0.1]", ""),
        (TOOL, {"mass": 2.0, "com": np.zeros(3)}, "mass 2, com [0, 0, 0]", ""),
        (TORQUE_SIGN, {}, "by_actuator", ""),
        (TORQUE_SIGN, {"gain": np.full(6, -1.0)}, "on_arm", ""),
        (TORQUE_SIGN, {"gain": np.zeros(6)}, "by_actuator", ""),
        (ANGLE_ORDER, {"angle_order": (2, -1, 3, 4, 5, 6)}, "2 -1 3 4 5 6", ""),
        (TORQUE_ORDER, {"torque_order": (1, 2, 3, 6, 5, 4)}, "1 2 3 6 5 4", ""),
        (ZEROS, {}, "as read", ""),
        (
            ZEROS,
            {"angle_zero": (0.0, np.radians(90.0), 0.0, 0.0, 0.0, np.radians(-5.04))},
            f"{ARM.joints[1].name} +90 degrees, {ARM.joints[5].name} -5 degrees",
            "",
        ),
        (DELAYED_TORQUES, {}, "none", ""),
        (DELAYED_TORQUES, {"torque_delay": 0.0123}, "12 ms late", ""),
        (DELAYED_TORQUES, {"torque_delay": -0.004}, "4 ms early", ""),
        (FROZEN_TORQUES, {}, "none", ""),
        (FROZEN_TORQUES, {"gain": np.array([1.0, 1.0, 0.0, 1.0, 1.0, 1.0])}, ARM.joints[2].name, ""),
        ("joint torques: scale", {"gain": np.full(6, 1e3)}, "1e+03 per Nm", "they are in mNm"),
        ("joint torques: scale", {"gain": np.full(6, -2.0)}, "2 per Nm", ""),
        ("joint torques: scale", {"gain": np.array([1, 1, 2, 0, 1, 1])}, "[1, 1, 2, 1, 1, 1] per Nm", ""),
    ],
)
def test_a_line_of_the_arm_or_its_signals(line: str, change: dict[str, Any], text: str, remark: str) -> None:
    assert line_value(line, replace(Setup.of(CELL), **change), CELL) == (text, remark)


TO_POUNDS = np.diag([1.0 / 4.448222] * 3 + [1.0 / 0.1129848] * 3)


@pytest.mark.parametrize(
    ("line", "change", "text", "remark"),
    [
        ("base_wrench.sign", {}, "arm_on_sensor", ""),
        ("base_wrench.sign", {"sign": -1.0}, "sensor_on_arm", ""),
        ("base_wrench.translation", {"translation": np.array([0.0, -0.1, 0.0504])}, "[0, -0.1, 0.05]", ""),
        ("base_wrench.delay", {"delay": 0.01234}, "0.0123", ""),
        ("base wrench: force and moment", {}, "force first", ""),
        ("base wrench: force and moment", {"order": np.roll(READ, 3, axis=0)}, "moment first", ""),
        ("base wrench: order of axes", {}, "x y z", ""),
        ("base wrench: order of axes", {"order": np.roll(READ, 3, axis=0)}, "x y z", ""),
        (
            "base wrench: order of axes",
            {"order": READ[[1, 0, 2, 4, 3, 5]] * np.array([[1.0, -1.0, 1.0] * 2]).T},
            "y -x z",
            "",
        ),
        (
            "base wrench: order of axes",
            {"order": READ[[1, 0, 2, 3, 4, 5]]},
            "forces y x z, moments x y z",
            "",
        ),
        ("base wrench: scale", {}, "1 per N, 1 per Nm", ""),
        (
            "base wrench: scale",
            {"order": np.diag([1.0] * 3 + [1e3] * 3)},
            "1 per N, 1e+03 per Nm",
            "forces are in N, moments in Nmm",
        ),
        (
            "base wrench: scale",
            {"order": TO_POUNDS},
            "0.225 per N, 8.85 per Nm",
            "forces are in lbf, moments in lbf in",
        ),
        ("base wrench: scale", {"order": 3.3 * READ}, "3.3 per N, 3.3 per Nm", ""),
        ("base wrench: frozen values", {}, "none", ""),
        (
            "base_wrench.rpy",
            {"rotation": Rotation.from_euler("z", 91.0, degrees=True).as_matrix()},
            "[0, 0, 1.5708]",
            "turned by 90 degrees about z",
        ),
        (
            "base_wrench.rpy",
            {"rotation": Rotation.from_euler("x", -90.0, degrees=True).as_matrix()},
            "[-1.5708, 0, 0]",
            "turned by 90 degrees about -x",
        ),
        (
            "base_wrench.rpy",
            {"rotation": Rotation.from_euler("xyz", (0.1, -0.2, 0.3)).as_matrix()},
            "[0.1, -0.2, 0.3]",
            "",
        ),
    ],
)
def test_a_line_of_a_force_torque_sensor(line: str, change: dict[str, Any], text: str, remark: str) -> None:
    setup = replace(Setup.of(CELL), sensors={"base_wrench": replace(SENSOR, **change)})
    assert line_value(line, setup, CELL) == (text, remark)
