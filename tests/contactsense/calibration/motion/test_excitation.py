"""Proposed motions keep to what was asked, and a calibration from one finds all that was promised."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Scene, WrenchSensor
from contactsense.benchmarks.calibration.simulate import simulate
from contactsense.calibration import CalibrationError, Settings, calibrate
from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.motion.clearance import Clearance
from contactsense.calibration.motion.excitation import (
    ExcitationSettings,
    Proposal,
    groups_of,
    propose_excitation,
)
from contactsense.calibration.motion.expected_uncertainty import simulated_free_motion
from contactsense.calibration.motion.fourier_trajectory import FourierTrajectory
from contactsense.calibration.parameters import value
from contactsense.robots.tool import Tool
from contactsense.sensors.settings import Friction
from tests.plain_arm import plain_ur5e
from tests.unknown_limits import without_limits

SEARCHED = Scene(
    robot=plain_ur5e(), joint_torque=JointTorqueSensor(friction=Friction(velocity=0.05), noise=0.5)
)
TRUTH = SEARCHED.model_copy(
    update={
        "joint_torque": JointTorqueSensor(
            friction=Friction(
                coulomb=(8.0, 7.0, 4.0, 1.5, 1.2, 1.0),
                viscous=(10.0, 9.0, 5.0, 2.0, 1.5, 1.0),
                velocity=0.05,
            ),
            rotor_inertia=(3.0, 2.5, 1.5, 0.4, 0.3, 0.3),
            bias=(0.5, -0.4, 0.3, -0.2, 0.1, 0.05),
            noise=(0.5,) * 6,
        ),
        "base_wrench": WrenchSensor(
            bias=(12.0, -7.0, 20.0, 1.0, -2.0, 0.5),
            rpy=(0.02, -0.03, 0.01),
            translation=(0.01, 0.0, 0.02),
            delay=0.003,
        ),
        "tool": Tool(mass=1.5, com=(0.01, -0.02, 0.06)),
        "mounting": (0.01, -0.015, 0.0),
    }
)
HOME = np.array([0.0, -1.3, 1.5, -1.0, 0.8, 0.0])
SETTINGS = ExcitationSettings(seconds=16.0)


@pytest.fixture(scope="module")
def proposal() -> Proposal:
    return propose_excitation(SEARCHED, SETTINGS, trials=12)


@pytest.mark.slow
def test_a_calibration_from_it_identifies_all_that_was_promised(proposal: Proposal) -> None:
    """The stated uncertainty is the promised one, and the true values are within it."""
    stretch = simulate(TRUTH, proposal.motion, 1, 100.0)
    found = calibrate(SEARCHED, [stretch], Settings(groups_of(SEARCHED), widths=False))
    plant = CalibrationModel.of(TRUTH)
    # Where Plant counts from the scene that calibration started with.
    true = plant.with_values(
        turn=np.array([0.02, -0.03, 0.01]),
        shift=np.array([0.01, 0.0, 0.02]),
        tilt=np.array([-0.01, 0.015, 0.0]),
    )
    scores = []
    for item, std, excited in zip(
        found.values, proposal.expected.std, proposal.expected.excited, strict=True
    ):
        assert excited, item.entry.name
        assert not item.kept, item.entry.name
        assert 0.5 < item.std / std < 2.0, item.entry.name
        scores.append((item.after - value(true, item.entry)) / item.std)
    # Rotations are given by vectors here and by angles there: alike to 3e-4, which is little beside the rest.
    usual = [
        s for s, item in zip(scores, found.values, strict=True) if item.entry.group not in ("turn", "tilt")
    ]
    assert np.mean(np.square(usual)) < 2.0
    assert np.max(np.abs(usual)) < 4.0


@pytest.mark.slow
def test_it_respects_limits_and_clearance(proposal: Proposal) -> None:
    t = np.arange(0.0, SETTINGS.seconds, 0.02)
    q, qd, _ = proposal.motion.at(t)
    joints = SEARCHED.robot.joints
    low, high = np.array([joint.position_limits for joint in joints]).T
    assert ((low < q) & (q < high)).all()
    assert (np.abs(qd) <= 0.4001 * np.array([joint.velocity_limit for joint in joints])).all()
    ends = np.abs(proposal.motion.at(np.array([0.0, SETTINGS.seconds]))[1])
    assert ends.max() < 1e-9
    clearance = Clearance(SEARCHED, HOME, SETTINGS.clearance)
    assert clearance.lowest(q).min() >= SETTINGS.floor
    assert clearance.nearest(q).min() >= SETTINGS.clearance
    assert proposal.lowest >= SETTINGS.floor
    assert proposal.nearest >= SETTINGS.clearance


def test_it_keeps_a_distance_from_narrow_position_limits() -> None:
    low, high = HOME - 0.3, HOME + 0.2
    joints = [
        replace(joint, position_limits=(float(a), float(b)))
        for joint, a, b in zip(SEARCHED.robot.joints, low, high, strict=True)
    ]
    robot = replace(SEARCHED.robot, joints=tuple(joints))
    scene = SEARCHED.model_copy(update={"robot": robot})
    found = propose_excitation(scene, ExcitationSettings(seconds=8.0), trials=3)
    q, _, _ = found.motion.at(np.arange(0.0, 8.0, 0.01))
    assert (q > low + 0.049).all()
    assert (q < high - 0.049).all()


def test_a_joint_whose_largest_speed_is_not_known_is_named() -> None:
    robot = without_limits(SEARCHED.robot)
    robot = replace(robot, joints=(*SEARCHED.robot.joints[:5], robot.joints[5]))
    scene = SEARCHED.model_copy(update={"robot": robot})
    with pytest.raises(CalibrationError, match=r"largest speed of each joint, .* none of wrist_3_joint: add"):
        propose_excitation(scene, SETTINGS)


def test_clearance_includes_the_table_and_self_collision() -> None:
    clearance = Clearance(SEARCHED, HOME, 0.05)
    down = np.array([0.0, 0.5, 0.0, -1.0, 0.8, 0.0])  # upper arm below the horizontal
    folded = HOME.copy()
    folded[2] = 3.0  # forearm laid onto the upper arm
    assert clearance.lowest(np.array([HOME, down]))[0] > 0.1
    assert clearance.lowest(np.array([HOME, down]))[1] < 0.0
    # Of an upright arm the upper arm's end at the shoulder, 0.16 m above the table, is the lowest.
    upright = np.array([0.0, -np.pi / 2, 0.0, -np.pi / 2, 0.0, 0.0])
    assert 0.05 < clearance.lowest(upright[None])[0] < 0.16
    assert clearance.nearest(np.array([HOME, folded]))[0] > 0.05
    assert clearance.nearest(np.array([HOME, folded]))[1] < 0.05


def test_what_the_sensors_will_read_is_what_the_mock_reads() -> None:
    """Two descriptions of one arm, written separately."""
    chance = np.random.default_rng(0)
    motion = FourierTrajectory.draw(chance, HOME, np.full(6, 0.7), 6, 4.0)
    assert TRUTH.base_wrench is not None
    assert TRUTH.joint_torque is not None
    base = TRUTH.base_wrench.model_copy(update={"force_noise": 1e-9, "moment_noise": 1e-9, "delay": 0.0})
    torque = TRUTH.joint_torque.model_copy(update={"noise": (1e-9,) * 6})
    scene = TRUTH.model_copy(update={"joint_torque": torque, "base_wrench": base})
    ours, theirs = simulated_free_motion(scene, motion, 50.0), simulate(scene, motion, 0, 50.0)
    assert ours.torque is not None
    assert ours.reading is not None
    np.testing.assert_allclose(ours.torque, np.asarray(theirs.torque), atol=1e-6)
    np.testing.assert_allclose(ours.reading, np.asarray(theirs.reading), atol=1e-6)


def test_a_joint_that_cannot_be_excited_is_named() -> None:
    """The torque constant of the last joint, which carries no weight."""
    sensor = JointTorqueSensor(signal="actual_current", torque_constants=(10.0,) * 6)
    scene = Scene(robot=plain_ur5e(), base_wrench=None, joint_torque=sensor)
    found = propose_excitation(scene, ExcitationSettings(seconds=8.0), trials=2).expected
    kept = [entry.name for entry, excited in zip(found.entries, found.excited, strict=True) if not excited]
    assert "gain of wrist_3_joint" in kept
    assert np.isnan(found.std[~found.excited]).all()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (ExcitationSettings(home=(0.0, 1.2, 0.0, 0.0, 0.0, 0.0)), "home: this posture is lower than 0.05 m"),
        (ExcitationSettings(floor=3.0), "home: the default posture, that of UR arms, is lower than 3 m"),
        (ExcitationSettings(home=(0.0, 0.0)), "home: expected 6 angles, got 2"),
        (
            ExcitationSettings(home=(0.0, -1.5, 1.5, -1.5, -1.5, 17.0)),
            "home: this posture has wrist_3_joint at 17 rad, expected -6.28 to 6.28 rad",
        ),
        (ExcitationSettings(home=(0.0, -1.5, np.nan, -1.5, -1.5, 0.0)), "elbow_joint at nan rad"),
        (ExcitationSettings(seconds=1.0), "seconds: expected at least 4"),
        (ExcitationSettings(seconds=8.0, torque=0.01), "no motion of 8 s found"),
    ],
)
def test_infeasible_settings_are_refused(settings: ExcitationSettings, message: str) -> None:
    with pytest.raises(CalibrationError, match=message):
        propose_excitation(SEARCHED, settings, trials=2)
