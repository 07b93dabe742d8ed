"""The fit to the quietest samples obeys the same conditions as the fit to all of them."""

import numpy as np

from contactsense import JointTorqueSensor, Scene
from contactsense.benchmarks.calibration.simulate import simulate
from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.fourier_trajectory import FourierTrajectory
from contactsense.calibration.gauss_newton import row_stride
from contactsense.calibration.parameters import NOT_NEGATIVE, entries, value
from contactsense.calibration.trimmed_fit import trimmed_fit
from tests.plain_arm import plain_ur5e


def test_friction_and_rotors_are_not_negative() -> None:
    """Of drives that have none, half of the coefficients were: the quiet samples do not tell Coulomb and
    lubricant friction apart, and what cancels there looks like pushes elsewhere."""
    scene = Scene(robot=plain_ur5e(), base_wrench=None, joint_torque=JointTorqueSensor(noise=0.3))
    centre = np.array([0.0, -1.3, 1.5, -1.0, 0.8, 0.0])
    motion = FourierTrajectory.draw(np.random.default_rng(1), centre, np.full(6, 0.6), 5, 6.0)
    recording = simulate(scene, motion, 2, 125.0)
    arm = CalibrationModel.of(scene).with_values(velocity=0.02, lubricant_velocity=0.1)
    selected = entries(arm, ("bias", "coulomb", "viscous", "rotor", "lubricant"))
    free, stride = np.ones(len(selected), dtype=bool), row_stride([recording], scene.bandwidth)
    found = trimmed_fit(arm, arm, [recording], selected, free, stride)
    bounded = [value(found, entry) for entry in selected if entry.group in NOT_NEGATIVE]
    assert min(bounded) > -1e-12
    assert max(bounded) > 0.0
