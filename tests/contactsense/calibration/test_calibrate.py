"""Calibration finds what a simulated recording was made of, and says what it cannot find."""

import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Scene, WrenchSensor
from contactsense.benchmarks.calibration.recordings import read
from contactsense.benchmarks.calibration.simulate import simulate
from contactsense.calibration import Calibration, CalibrationError, FreeMotion, Settings, calibrate
from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.motion.fourier_trajectory import FourierTrajectory
from contactsense.calibration.residuals.recording_residuals import residuals
from contactsense.calibration.torque_signal_meaning import compare_meanings, setting_warnings
from contactsense.robots.tool import Tool
from contactsense.scene_model.wrench_map import WrenchMap
from contactsense.sensors.settings import Friction
from contactsense.setup_check import check
from tests.plain_arm import plain_ur5e
from tests.shared import shared
from tests.unknown_limits import without_limits

CENTER = np.array([0.0, -1.3, 1.5, -1.0, 0.8, 0.0])
FRICTION = Friction(
    coulomb=(8.0, 7.0, 4.0, 1.5, 1.2, 1.0), viscous=(10.0, 9.0, 5.0, 2.0, 1.5, 1.0), velocity=0.05
)
TORQUE = JointTorqueSensor(
    friction=FRICTION,
    rotor_inertia=(3.0, 2.5, 1.5, 0.4, 0.3, 0.3),
    bias=(0.5, -0.4, 0.3, -0.2, 0.1, 0.05),
    noise=(1.0, 1.0, 0.8, 0.3, 0.3, 0.3),
)
WRENCH = WrenchSensor(
    bias=(12.0, -7.0, 20.0, 1.0, -2.0, 0.5), rpy=(0.02, -0.03, 0.2), delay=0.004, force_noise=0.5
)
TRUTH = Scene(
    robot=plain_ur5e(),
    joint_torque=TORQUE,
    base_wrench=WRENCH,
    tool=Tool(mass=1.5, com=(0.01, -0.02, 0.06)),
    mounting=(0.01, -0.015, 0.0),
)
SEARCHED = Scene(
    robot=plain_ur5e(),
    joint_torque=JointTorqueSensor(friction=Friction(velocity=0.05)),
    base_wrench=WrenchSensor(rpy=(0.0, 0.0, 0.2)),
)


def _motion(seconds: float = 20.0, still: tuple[int, ...] = ()) -> FourierTrajectory:
    speed = np.array([0.0 if j in still else 0.7 for j in range(6)])
    return FourierTrajectory.draw(np.random.default_rng(4), CENTER, speed, 8, seconds)


@pytest.fixture(scope="module")
def found() -> Calibration:
    settings = Settings(
        ("payload", "bias", "coulomb", "viscous", "rotor", "wrench_bias", "tilt", "turn", "delay"),
        widths=False,
    )
    return calibrate(SEARCHED, [simulate(TRUTH, _motion(), 1, 250.0)], settings)


@pytest.mark.slow
def test_limits_that_are_not_known_change_little() -> None:
    """They are only the size of what is expected, which a motion of all joints outweighs."""
    recording = simulate(TRUTH, _motion(8.0), 1, 250.0)
    settings = Settings(("bias", "coulomb", "viscous", "rotor"), widths=False)
    scene = TRUTH.model_copy(update={"joint_torque": SEARCHED.joint_torque})
    unknown = scene.model_copy(update={"robot": without_limits(scene.robot)})
    known, other = (calibrate(given, [recording], settings).values for given in (scene, unknown))
    for one, two in zip(known, other, strict=True):
        assert two.after == pytest.approx(one.after, abs=0.1 * one.std)
        assert two.std == pytest.approx(one.std, rel=0.1)


@pytest.mark.slow
def test_estimates_are_within_their_uncertainty(found: Calibration) -> None:
    truth = {
        "coulomb": FRICTION.coulomb,
        "viscous": FRICTION.viscous,
        "rotor": TORQUE.rotor_inertia,
        "bias": TORQUE.bias,
        "wrench_bias": WRENCH.bias,
        "payload": (1.5, 0.015, -0.03, 0.09),
    }
    scores = []
    for value in found.values:
        if value.entry.group in truth:
            expected = np.asarray(truth[value.entry.group])[value.entry.index]
            assert value.kept == "", value.entry.name
            assert value.std > 0.0
            scores.append((value.after - expected) / value.std)
        if value.entry.group == "delay":
            assert value.after == pytest.approx(WRENCH.delay, abs=4.0 * value.std)
    # 34 standard normals: the largest is beyond 4 once in 500 sets, their square's mean beyond 2 in 10,000.
    assert np.abs(scores).max() < 4.0
    assert np.mean(np.square(scores)) < 2.0


@pytest.mark.slow
def test_its_scene_explains_the_recording(found: Calibration) -> None:
    assert np.all(found.after.rms < 0.2 * found.before.rms)
    np.testing.assert_allclose(found.scene.gravity_base, TRUTH.gravity_base, atol=0.02)
    assert found.scene.base_wrench is not None
    np.testing.assert_allclose(found.scene.base_wrench.rotation, WRENCH.rotation, atol=2e-3)
    assert found.scene.tool is not None
    assert found.scene.tool.mass == pytest.approx(1.5, abs=0.05)
    assert found.scene.joint_torque is not None
    # The fast part of the residual, and little else.
    np.testing.assert_allclose(found.scene.joint_torque.noise, TORQUE.noise, rtol=0.15)
    again = Scene.model_validate(found.scene.model_dump() | {"robot": plain_ur5e()})
    assert again.joint_torque == found.scene.joint_torque


@pytest.mark.slow
def test_a_sensor_far_from_where_the_scene_has_it_is_found() -> None:
    """The sensor is turned, so at first residuals are so large that the motion seems to tell little of
    its height."""
    sensor = WRENCH.model_copy(update={"translation": (0.01, -0.02, -0.1), "rpy": (0.02, -0.03, 0.5)})
    truth = TRUTH.model_copy(update={"base_wrench": sensor, "joint_torque": None})
    scene = SEARCHED.model_copy(update={"base_wrench": WrenchSensor(), "joint_torque": None})
    found = calibrate(scene, [simulate(truth, _motion(12.0), 2, 250.0)])
    kept = [value.entry.name for value in found.values if value.kept]
    assert kept == []
    assert found.scene.base_wrench is not None
    np.testing.assert_allclose(found.scene.base_wrench.translation, sensor.translation, atol=2e-3)
    assert found.scene.base_wrench.moment_noise == pytest.approx(sensor.moment_noise, rel=0.2)


@pytest.mark.slow
def test_a_late_sensor_is_found_in_slow_motion() -> None:
    """The noise of the readings changes faster than the readings themselves."""
    late = WRENCH.model_copy(update={"delay": 0.03})
    speed = np.full(6, 0.2)
    motion = FourierTrajectory.draw(np.random.default_rng(4), CENTER, speed, 8, 12.0)
    recording = simulate(TRUTH.model_copy(update={"base_wrench": late}), motion, 5, 500.0)
    result = calibrate(SEARCHED, [recording])
    (delay,) = [value for value in result.values if value.entry.group == "delay"]
    assert delay.std < 1e-3
    assert delay.after == pytest.approx(late.delay, abs=4.0 * delay.std)


def test_a_joint_that_does_not_move_is_named_and_kept() -> None:
    stretch = simulate(TRUTH, _motion(10.0, still=(5,)), 2, 100.0)
    result = calibrate(SEARCHED, [stretch], Settings(("bias", "coulomb", "viscous", "rotor"), widths=False))
    kept = {value.entry.name for value in result.values if value.kept}
    last = SEARCHED.robot.joints[5].name
    assert kept == {f"{group} of {last}" for group in ("bias", "coulomb", "viscous", "rotor")}
    assert any(f"coulomb of {last}: not excited" in warning for warning in result.warnings)
    assert all(value.after == value.before for value in result.values if value.kept)


@pytest.mark.parametrize("meaning", ["gravity_free", "external"])
def test_a_wrong_meaning_of_the_torque_signal_is_reported(meaning: str) -> None:
    other = TRUTH.model_copy(update={"joint_torque": TORQUE.model_copy(update={"meaning": meaning})})
    stretch = simulate(other, _motion(8.0), 3, 100.0)
    result = calibrate(SEARCHED, [stretch], Settings(("bias", "coulomb", "viscous", "rotor"), widths=False))
    assert f"joint_torque.meaning: {meaning}" in result.warnings[0]


def test_a_wrong_sign_of_the_torque_signal_is_reported() -> None:
    stretch = simulate(TRUTH, _motion(8.0), 3, 100.0)
    assert stretch.torque is not None
    turned = FreeMotion(stretch.t, stretch.q, stretch.qd, -stretch.torque)
    result = calibrate(SEARCHED, [turned], Settings(("bias", "coulomb", "viscous", "rotor"), widths=False))
    assert "joint_torque.sign: on_arm" in result.warnings[0]


def test_an_arm_at_rest_says_nothing_of_the_torque_signal() -> None:
    q = np.tile(CENTER, (500, 1))
    recording = FreeMotion(np.arange(500) * 0.01, q, 0.0 * q, torque=0.0 * q)
    assert setting_warnings(SEARCHED, compare_meanings(SEARCHED, [recording], 10.0)) == []


def test_an_arm_at_rest_says_nothing_of_the_orientation_of_its_base_sensor() -> None:
    """The noise of the readings is turned with them, and seemed to tell it to one degree."""
    scene = SEARCHED.model_copy(update={"joint_torque": None})
    rng, q = np.random.default_rng(5), np.tile(CENTER, (1500, 1))
    rest = FreeMotion(np.arange(1500) * 0.008, q, 0.0 * q, reading=np.zeros((1500, 6)))
    weight = -residuals(CalibrationModel.of(scene), rest, scene.bandwidth)[-1, 6:]
    noise = np.repeat([0.5, 0.05], 3) * rng.standard_normal((1500, 6))
    sensor = WrenchMap.of(scene.base_wrench or WrenchSensor())
    reading = sensor.reading(np.tile(weight, (1500, 1))) + np.array([4.0, -3.0, 2.0, 1.0, 0.5, 0.2]) + noise
    found = calibrate(scene, [replace(rest, reading=reading)])
    assert found.scene.base_wrench is not None
    assert found.scene.base_wrench.rpy == pytest.approx((0.0, 0.0, 0.2), abs=1e-9)
    assert {value.entry.name for value in found.values if value.kept} >= {"turn x", "turn y", "turn z"}


def test_unusable_recordings_are_refused() -> None:
    with pytest.raises(CalibrationError, match="at least one recording"):
        calibrate(SEARCHED, [])
    q = np.zeros((500, 6))
    with pytest.raises(CalibrationError, match="nothing: expected joint torques or base wrenches"):
        calibrate(SEARCHED, [FreeMotion(np.arange(500) * 0.01, q, q, name="nothing")])
    with pytest.raises(CalibrationError, match=r"brief: expected at least 2 s, got 0\.9"):
        calibrate(SEARCHED, [FreeMotion(np.arange(91) * 0.01, q[:91], q[:91], q[:91], name="brief")])
    inner = FreeMotion(np.arange(500) * 0.01, q, q, q, name="inner", link_readings={"elbow_wrench": q})
    with pytest.raises(CalibrationError, match=r"inner: link_readings: expected .*none\), got elbow_wrench"):
        calibrate(SEARCHED, [inner])
    with pytest.raises(ValueError, match="rough: torque: expected finite numbers, got nan"):
        FreeMotion(np.arange(500) * 0.01, q, q, np.full((500, 6), np.nan), name="rough")
    with pytest.raises(ValueError, match=r"huge: reading: expected values up to 1e\+12, got 1e\+300"):
        FreeMotion(np.arange(500) * 0.01, q, q, reading=np.full((500, 6), -1e300), name="huge")
    with pytest.raises(ValueError, match="twice: t: expected 500 increasing times"):
        FreeMotion(np.zeros(500), q, q, name="twice")


def test_a_fit_that_no_arm_can_have_is_refused_by_its_field(monkeypatch: pytest.MonkeyPatch) -> None:
    """As that of velocities 1e10 times too large: it ended with the errors of a type in the scene."""

    def impossible(*_: object) -> Scene:
        return SEARCHED.model_copy(update={"joint_torque": Friction(error=(3e7,) * 6)})

    monkeypatch.setattr(sys.modules["contactsense.calibration.calibrate"], "scene_of", impossible)
    part = simulate(TRUTH, _motion(4.0), 3, 100.0)
    settings = Settings(("bias", "coulomb", "viscous", "rotor"), widths=False, leave_out_contacts=False)
    told = (
        r"recording 3: expected .* got a fit with friction[.]error\[0\] out of bounds "
        r"\(expected a number of at most 1000000, got 30000000[.]0\): "
    )
    with pytest.raises(CalibrationError, match=told):
        calibrate(SEARCHED, [part], settings)


@pytest.mark.parametrize("function", [calibrate, check])
def test_recordings_of_another_type_are_named(function: Callable[[Any, Any], object]) -> None:
    q = np.zeros((500, 6))
    part = FreeMotion(np.arange(500) * 0.01, q, q, q)
    with pytest.raises(TypeError, match=r"^recordings: expected a list of FreeMotion, got FreeMotion$"):
        function(SEARCHED, part)
    with pytest.raises(TypeError, match=r"^recordings\[0\]: expected FreeMotion, got list$"):
        function(SEARCHED, ([part], ()))  # what read_free_motion returns
    with pytest.raises(TypeError, match=r"^scene: expected a Scene, as in "):
        function([part], SEARCHED)


def test_joints_that_must_move_are_named() -> None:
    scene = Scene(robot="ur10e", base_wrench=None, joint_torque=JointTorqueSensor(signal="actual_current"))
    only_the_first = read(shared("ur10e_recordings") / "jointwise-joint_1.csv.gz", scene)[0]
    with pytest.raises(CalibrationError, match=r"at rest throughout: shoulder_lift_joint, .*wrist_3_joint$"):
        calibrate(scene, [only_the_first])
