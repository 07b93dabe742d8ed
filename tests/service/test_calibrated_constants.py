"""Whether a calibration that has corrected the torque constants is trusted."""

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Scene, WrenchSensor
from contactsense.benchmarks.calibration.simulate import simulate
from contactsense.calibration import Settings, calibrate
from contactsense.calibration.motion.fourier_trajectory import FourierTrajectory
from contactsense.service.cli.calibration_doubts import doubts

SCENE = Scene(
    robot="ur10e",
    detail="coarse",
    base_wrench=WrenchSensor(force_noise=0.25, moment_noise=0.05),
    joint_torque=JointTorqueSensor(signal="actual_current", noise=0.5),
)


@pytest.mark.slow
def test_constants_that_a_calibration_has_corrected_are_not_wrong_by_the_correction() -> None:
    """The recording was read with the constants before: what was corrected by a quarter seemed to be wrong
    by a quarter, and the result was not to be used."""
    center = np.array([0.0, -1.3, 1.5, -1.0, 0.8, 0.0])
    motion = FourierTrajectory.draw(np.random.default_rng(4), center, np.full(6, 0.9), 6, 12.0)
    gain = np.array([0.75, 0.75, 0.8, 0.75, 1.0, 1.0])
    recording = simulate(SCENE, motion, 1, 125.0, gain=gain)
    found = calibrate(SCENE, [recording], Settings(("bias", "gain"), widths=False))
    assert found.scene.joint_torque is not None
    constants = np.array(found.scene.joint_torque.torque_constants)
    stated = np.array([joint.torque_constant for joint in SCENE.robot.joints])
    np.testing.assert_allclose(constants[:3], (gain * stated)[:3], rtol=0.03)
    assert doubts(found, SCENE, [recording]) == ()
