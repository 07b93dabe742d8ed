"""Bias, pose and delay of sensors within the arm are found in recordings made by independent dynamics."""

import numpy as np
import pytest

from contactsense import JointTorqueSensor, LinkWrenchSensor, Scene, WrenchSensor
from contactsense.benchmarks.calibration.simulate import Push, simulate
from contactsense.calibration import Calibration, FreeMotion, Settings, calibrate, default_groups
from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.motion.expected_uncertainty import expected_uncertainty
from contactsense.calibration.motion.fourier_trajectory import FourierTrajectory
from contactsense.calibration.parameters import OF_LINK_SENSORS, apply_step, entries
from contactsense.calibration.residuals.equations import all_residuals, channels, linearize_all
from contactsense.calibration.residuals.link_residuals import link_residuals
from contactsense.calibration.residuals.recording_residuals import residuals, samples_of_rows
from contactsense.calibration.residuals.smooth_velocities import with_smooth_velocities
from contactsense.robots.tool import Tool
from contactsense.sensors.settings import Friction
from tests.plain_arm import plain_ur5e

pytestmark = pytest.mark.slow

ARM = plain_ur5e()
TOOL = Tool(mass=1.5, com=(0.01, -0.02, 0.06))
BASE = WrenchSensor(bias=(12.0, -7.0, 20.0, 1.0, -2.0, 0.5), force_noise=0.3, moment_noise=0.05)
WRIST = WrenchSensor(
    rpy=(0.02, -0.03, 0.7), translation=(0.0, 0.0, 0.02), sign="sensor_on_arm", delay=0.008,
    bias=(3.0, -2.0, 5.0, 0.2, -0.1, 0.3), force_noise=0.2, moment_noise=0.01,
)  # fmt: skip
ELBOW = LinkWrenchSensor(
    name="elbow", link="forearm", rpy=(0.5, -0.2, 0.1), translation=(0.01, 0.0, 0.03), delay=-0.006,
    bias=(-4.0, 6.0, 2.0, 0.5, 0.4, -0.6), force_noise=0.4, moment_noise=0.03,
)  # fmt: skip
TRUTH = Scene(
    robot=ARM, joint_torque=None, base_wrench=BASE, tool=TOOL, wrist_wrench=WRIST, link_wrenches=(ELBOW,)
)
SEARCHED = Scene(
    robot=ARM,
    joint_torque=None,
    base_wrench=WrenchSensor(),
    tool=Tool(mass=1.0),
    wrist_wrench=WrenchSensor(rpy=(0.0, 0.0, 0.7), translation=(0.0, 0.0, 0.02), sign="sensor_on_arm"),
    link_wrenches=[
        LinkWrenchSensor(name="elbow", link="forearm", rpy=(0.45, -0.2, 0.1), translation=(0.0, 0.0, 0.03))
    ],
)
FIELDS = ("link_wrenches.elbow", "wrist_wrench")


def motion(seconds: float) -> FourierTrajectory:
    centre = np.array([0.0, -1.3, 1.5, -1.0, 0.8, 0.0])
    return FourierTrajectory.draw(np.random.default_rng(4), centre, np.full(6, 0.7), 8, seconds)


@pytest.fixture(scope="module")
def recording() -> FreeMotion:
    return simulate(TRUTH, motion(20.0), 1, 125.0)


@pytest.fixture(scope="module")
def found(recording: FreeMotion) -> Calibration:
    groups = default_groups(SEARCHED, [recording])
    assert set(OF_LINK_SENSORS) < set(groups)
    return calibrate(SEARCHED, [recording], Settings(groups))


def without_noise(scene: Scene) -> Scene:
    none = {"force_noise": 1e-9, "moment_noise": 1e-9}
    assert scene.base_wrench is not None
    assert scene.wrist_wrench is not None
    return scene.model_copy(
        update={
            "base_wrench": scene.base_wrench.model_copy(update=none),
            "wrist_wrench": scene.wrist_wrench.model_copy(update=none),
            "link_wrenches": tuple(sensor.model_copy(update=none) for sensor in scene.link_wrenches),
        }
    )


def test_the_truth_leaves_nothing() -> None:
    scene = without_noise(TRUTH)
    # The delays are whole steps, so that nothing is interpolated.
    exact = simulate(scene, motion(5.0), 1, 500.0)
    residual = all_residuals(CalibrationModel.of(scene), exact, scene.bandwidth)
    assert residual.shape == (len(exact.t), channels(scene)) == (len(exact.t), 24)
    # At the end, readings that would arrive later are missing.
    assert np.abs(residual[200:-5, 12:]).max() < 1e-3
    assert np.abs(exact.link_readings["wrist_wrench"]).max() > 10.0


def test_derivatives_are_those_of_the_residuals() -> None:
    """All but those of the delay, as the interpolation between samples has kinks there, and of the
    orientation, which follow from the wrench by the model; in the frame of the sensor that does not move with
    the parameters."""
    recording = simulate(without_noise(TRUTH), motion(5.0), 1, 125.0)
    arm = CalibrationModel.of(SEARCHED)
    selected = entries(arm, ("payload", "link_bias", "link_shift", "links"), 0.1)
    step = 1e-4 * np.array([entry.prior_std for entry in selected])
    step *= np.random.default_rng(2).choice([-1.0, 1.0], len(step))
    moved, bandwidth = apply_step(arm, selected, step), SEARCHED.bandwidth
    smooth = with_smooth_velocities(recording)
    # Masses have the derivatives of a motion without the noise of its velocities; those of the others are
    # hardly changed by it.
    own, before, after = (
        np.hstack(
            [
                residuals(x, part, bandwidth, about=arm),
                *(link_residuals(x, part, field, bandwidth, seen_by=arm) for field in FIELDS),
            ]
        )[samples_of_rows(recording, bandwidth)]
        for x, part in ((arm, recording), (arm, smooth), (moved, smooth))
    )
    for old in linearize_all(arm, recording, selected, bandwidth):
        change = (after - before)[:, old.channel]
        predicted = old.slope @ step[old.columns]
        np.testing.assert_array_equal(old.residual, own[:, old.channel])
        np.testing.assert_allclose(change, predicted, atol=1e-3 * np.abs(change).max() + 1e-9)
        assert np.abs(change).max() > 0.0 or old.channel < 6


def test_estimates_are_within_their_uncertainty(found: Calibration) -> None:
    turn = {}
    for field, stated in SEARCHED.link_sensors.items():
        # The true orientation is the stated one, turned about the axes of the frame in which it is given.
        apart = TRUTH.link_sensors[field].rotation @ stated.rotation.T
        turn[field] = np.array(
            [apart[2, 1] - apart[1, 2], apart[0, 2] - apart[2, 0], apart[1, 0] - apart[0, 1]]
        )
    scores = []
    for value in found.values:
        field = value.entry.sensor
        if field is None:
            continue
        true, stated = TRUTH.link_sensors[field], SEARCHED.link_sensors[field]
        expected = {
            "link_bias": np.array(true.bias),
            "link_turn": 0.5 * turn[field],
            "link_shift": np.subtract(true.translation, stated.translation),
            "link_delay": np.array([true.delay]),
        }[value.entry.group]
        assert value.kept == "", value.entry.name
        scores.append((value.after - expected[(*value.entry.index[1:], 0)[0]]) / value.std)
    # 26 standard normals: the largest is beyond 4 once in 600 sets, their square's mean beyond 2 in 1,000.
    assert len(scores) == 26
    assert np.abs(scores).max() < 4.0
    assert np.mean(np.square(scores)) < 2.0


def test_the_uncertainty_is_the_one_that_the_motion_promises(found: Calibration) -> None:
    groups = tuple(dict.fromkeys(value.entry.group for value in found.values))
    expected = expected_uncertainty(TRUTH, groups, motion(20.0), 125.0)
    assert [entry.name for entry in expected.entries] == [value.entry.name for value in found.values]
    for std, value in zip(expected.std, found.values, strict=True):
        if value.entry.sensor is not None:
            assert 0.5 < value.std / std < 2.0, value.entry.name


def test_its_scene_has_the_sensors_as_they_are(found: Calibration) -> None:
    scene = found.scene
    for field in FIELDS:
        true, got = TRUTH.link_sensors[field], scene.link_sensors[field]
        np.testing.assert_allclose(got.bias[:3], true.bias[:3], atol=0.2)
        np.testing.assert_allclose(got.bias[3:], true.bias[3:], atol=0.02)
        np.testing.assert_allclose(got.rotation, true.rotation, atol=5e-3)
        assert got.delay == pytest.approx(true.delay, abs=2e-3)
        assert got.force_noise == pytest.approx(true.force_noise, rel=0.2)
        assert got.moment_noise == pytest.approx(true.moment_noise, rel=0.2)
        assert got.sign == true.sign
    assert scene.tool is not None
    assert scene.tool.mass == pytest.approx(TOOL.mass, abs=0.02)
    assert Scene.model_validate(scene.model_dump() | {"robot": ARM}) == scene


@pytest.mark.slow
def test_a_push_that_only_a_sensor_within_the_arm_feels_is_left_out() -> None:
    """On a wrist whose drives hold more than that, without a base sensor."""
    torque = JointTorqueSensor(
        friction=Friction(coulomb=5.0, viscous=5.0, velocity=0.05), rotor_inertia=(1.0,) * 6, noise=2.0
    )
    scene = TRUTH.model_copy(update={"base_wrench": None, "joint_torque": torque, "wrist_wrench": None})
    push = Push(4, (0.0, 0.05, 0.0), (1.2, -1.6, 1.6), 5.0, 6.0)
    pushed = simulate(scene, motion(12.0), 3, 125.0, pushes=[push])
    groups = ("payload", "bias", "coulomb", "viscous", "rotor", *OF_LINK_SENSORS)
    (contact,) = calibrate(scene, [pushed], Settings(groups, widths=False)).contacts
    assert contact.start < 5.2
    assert contact.stop > 5.8
    assert contact.channels[0] >= 12
    alone = scene.model_copy(update={"link_wrenches": ()})
    blind = pushed.with_readings({})
    assert not calibrate(alone, [blind], Settings(groups[:5], widths=False)).contacts
