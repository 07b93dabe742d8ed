"""Whatever comes, and whatever fails to come: no number that leaves the stream is other than finite."""

import numpy as np
import pytest

from contactsense import Estimate, JointTorqueSensor, Localizer, Sample, Scene, WrenchSensor
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.robots.primitives import Sphere
from contactsense.robots.tool import Tool
from tests.at_rest import weight
from tests.plain_arm import plain_ur5e

ARM = plain_ur5e()
POSTURE = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5])
TOOL = Tool(mass=1.0, com=(0.0, 0.0, 0.05), primitives=(Sphere(center=(0.0, 0.0, 0.1), radius=0.03),))
BASE, TORQUE, WRIST = WrenchSensor(), JointTorqueSensor(), WrenchSensor()
SCENES = {
    "torques": Scene(robot=ARM, base_wrench=None, joint_torque=TORQUE),
    "base": Scene(robot=ARM, base_wrench=BASE, joint_torque=None),
    "both": Scene(robot=ARM, base_wrench=BASE, joint_torque=TORQUE, inertia_error=0.02),
    "all": Scene(robot=ARM, base_wrench=BASE, joint_torque=TORQUE, wrist_wrench=WRIST, tool=TOOL),
}


def _push(chance: np.random.Generator) -> np.ndarray:
    """A force somewhere on the forearm, about the base origin, with or without sense."""
    motion = empty_motion(6)
    forward_kinematics(build_model(ARM), POSTURE, motion)
    point = motion.rotation[3] @ np.array([-0.2, 0.04, 0.007]) + motion.origin[3]
    force = motion.rotation[3] @ np.array([0.0, chance.choice([-1.0, 1.0, 0.0]), 0.1])
    return np.concatenate((force, np.cross(point, force)))


def _check(estimate: Estimate, case: object) -> None:
    numbers = [estimate.link_probability, estimate.wrench, estimate.covariance, estimate.other]
    for contact in estimate.contacts:
        numbers += [
            contact.probability, contact.point, contact.point_base, contact.normal_base, contact.force_base,
            contact.torsion, contact.covariance,
        ]  # fmt: skip
    for number in numbers:
        assert np.isfinite(number).all(), (case, estimate)


@pytest.mark.parametrize("name", ["torques", "base"])
def test_a_sensor_with_one_value_after_a_gap_is_not_settled(name: str) -> None:
    """At 40 Hz, within a stream at 500 Hz, it may be silent for 150 ms; its observer settles for 80 ms."""
    torque, wrench = weight(Scene(robot=ARM), POSTURE)
    localizer = Localizer(SCENES[name])
    for i in range(1500):
        t = 0.002 * i
        speaks = (t < 1.0 and i % 12 == 0) or i == 1000
        sample = Sample(
            t, POSTURE, np.zeros(6),
            torque if speaks and name == "torques" else None,
            wrench if speaks and name == "base" else None,
        )  # fmt: skip
        estimate = localizer.step(sample)
        _check(estimate, t)
        assert not estimate.contacts, t
        if t > 1.3:
            assert estimate.status == "degraded", t


@pytest.mark.parametrize("name", list(SCENES))
def test_missing_and_invalid_sensors_never_raise(name: str) -> None:
    """Silences of all lengths, odd rates, pushes, values and times that mean nothing."""
    torque, wrench = weight(Scene(robot=ARM), POSTURE)
    chance, localizer, t = np.random.default_rng(5), Localizer(SCENES[name]), 0.0
    odd = [0.0, 1e-300, 1e9, -1e30, 1e160, 1e300, np.inf, np.nan]
    off, rate, push, touched = np.zeros(3), np.ones(3, dtype=int), np.zeros(6), 0
    for i in range(4000):
        t += chance.choice(
            [0.002, 0.004, 0.01, 0.06, 0.5, 1e7, -0.1], p=[0.9, 0.05, 0.04, 0.004, 0.004, 0.001, 0.001]
        )
        for k in np.flatnonzero(chance.random(3) < 0.01):
            off[k], rate[k] = t + chance.choice([0.0, 0.03, 0.1, 0.3, 2.0]), chance.choice([1, 2, 7, 15])
        if chance.random() < 0.02:
            push = chance.choice([0.0, 1.0, 20.0, 1e3]) * _push(chance)
        values: list[np.ndarray | None] = []
        for k, value in enumerate((torque + 0.3 * push, wrench + push, push)):
            if t < off[k] or i % rate[k]:
                values.append(None)
                continue
            read = value + 0.1 * chance.standard_normal(6)
            if chance.random() < 0.003:
                read[chance.integers(6)] = chance.choice(odd)
            values.append(read)
        there = SCENES[name]
        sample = Sample(
            t, POSTURE + 1e-3 * np.sin(t), np.zeros(6),
            values[0] if there.joint_torque is not None else None,
            values[1] if there.base_wrench is not None else None,
            values[2] if there.wrist_wrench is not None else None,
        )  # fmt: skip
        estimate = localizer.step(sample)
        _check(estimate, (i, t))
        touched += bool(estimate.contacts)
    assert touched > 100
