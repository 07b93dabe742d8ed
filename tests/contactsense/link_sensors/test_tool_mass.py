"""A force/torque sensor in the flange, and a tool that is heavier than stated."""

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Readings, Sample, Scene, WrenchSensor, forward_model
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.robots.tool import Tool
from tests.plain_arm import plain_ur5e

pytestmark = pytest.mark.slow  # its kernels compile for long

ARM = plain_ur5e()
STATED = Tool(mass=1.5, com=(0.02, -0.01, 0.06))
HEAVIER = STATED.model_copy(update={"mass": 1.08 * STATED.mass})
NOTHING = np.zeros(3)
WRIST = WrenchSensor(force_noise=0.1, moment_noise=0.01)


def _scene(tool: Tool, error: float) -> Scene:
    base = WrenchSensor(force_noise=0.25, moment_noise=0.05)
    torque = JointTorqueSensor(noise=1.0)
    return Scene(
        robot=ARM, tool=tool, base_wrench=base, joint_torque=torque, wrist_wrench=WRIST, inertia_error=error
    )


def _posture(t: float) -> np.ndarray:
    """The tool turns over, each time at rest."""
    return np.array([0.2, -1.1, 1.3, -0.8 + 0.9 * np.sin(t), -1.2 + 0.8 * np.cos(t), 0.5 + t])


def _readings(q: np.ndarray, chance: np.random.Generator) -> Readings:
    """Readings with the heavier tool, with noise; that of the wrist is about the sensor's origin."""
    exact, motion = forward_model(_scene(HEAVIER, 0.0), q, "forearm", NOTHING, NOTHING), empty_motion(6)
    forward_kinematics(build_model(ARM), q, motion)
    origin = motion.origin[6] + motion.rotation[6] @ ARM.flange_translation
    force, moment = chance.standard_normal((2, 3)) * [[WRIST.force_noise], [WRIST.moment_noise]]
    assert exact.wrist_wrench is not None
    return exact._replace(
        joint_torque=exact.joint_torque + chance.standard_normal(6),
        base_wrench=exact.base_wrench + np.repeat([0.25, 0.05], 3) * chance.standard_normal(6),
        wrist_wrench=exact.wrist_wrench + np.concatenate((force, moment + np.cross(origin, force))),
    )


@pytest.mark.parametrize(("told", "touched"), [(0.05, False), (0.0, True)])
def test_in_a_stream_it_is_no_contact(told: float, touched: bool) -> None:
    chance, localizer, found = np.random.default_rng(0), Localizer(_scene(STATED, told)), []
    for i in range(800):
        q = _posture(0.002 * i)
        readings = _readings(q, chance)
        sample = Sample(
            0.004 * i, q, np.zeros(6), readings.joint_torque, readings.base_wrench, readings.wrist_wrench
        )
        found.append(localizer.step(sample).status != "none")
    assert np.mean(found[50:]) == float(touched)


@pytest.mark.parametrize(("told", "touched"), [(0.05, False), (0.0, True)])
def test_in_one_measurement_it_is_no_contact(told: float, touched: bool) -> None:
    chance, localizer, found = np.random.default_rng(1), Localizer(_scene(STATED, told)), []
    for i in range(20):
        q = _posture(0.1 * i)
        readings = _readings(q, chance)
        estimate = localizer.locate(
            q, base_wrench=readings.base_wrench, joint_torque=readings.joint_torque,
            wrist_wrench=readings.wrist_wrench, external=False,
        )  # fmt: skip
        found.append(estimate.status != "none")
    assert np.mean(found) == float(touched)
