"""The fit to the quietest samples: conditions of its parameters, and what it does not determine."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d

from contactsense import JointTorqueSensor, Scene
from contactsense.benchmarks.calibration.pushes import measure
from contactsense.benchmarks.calibration.simulate import simulate
from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.contacts.trimmed_fit import WINDOW, trimmed_fit
from contactsense.calibration.motion.fourier_trajectory import FourierTrajectory
from contactsense.calibration.parameters import NOT_NEGATIVE, entries, value
from contactsense.calibration.residuals.equations import all_residuals
from contactsense.calibration.residuals.recording_residuals import settled_samples
from contactsense.sensors.settings import Friction
from tests.plain_arm import plain_ur5e

CENTRE = np.array([0.0, -1.3, 1.5, -1.0, 0.8, 0.0])
RATE = 125.0


def test_friction_and_rotors_are_not_negative() -> None:
    """Of drives that have none, half of the coefficients were: the quiet samples do not tell Coulomb and
    lubricant friction apart, and what cancels there looks like pushes elsewhere."""
    scene = Scene(robot=plain_ur5e(), base_wrench=None, joint_torque=JointTorqueSensor(noise=0.3))
    motion = FourierTrajectory.draw(np.random.default_rng(1), CENTRE, np.full(6, 0.6), 5, 6.0)
    recording = simulate(scene, motion, 2, RATE)
    arm = CalibrationModel.of(scene).with_values(velocity=0.02, lubricant_velocity=0.1)
    selected = entries(arm, ("bias", "coulomb", "viscous", "rotor", "lubricant"))
    free = np.ones(len(selected), dtype=bool)
    found = trimmed_fit(arm, arm, [recording], selected, free).arm
    bounded = [value(found, entry) for entry in selected if entry.group in NOT_NEGATIVE]
    assert min(bounded) > -1e-12
    assert max(bounded) > 0.0


@pytest.mark.slow
def test_what_the_model_leaves_beyond_the_truth_is_as_large_as_its_uncertainty() -> None:
    """Up to a factor of two: the choice of the quietest samples is uncertain as well."""
    friction = Friction(coulomb=(5.0,) * 6, viscous=(4.0,) * 6, velocity=0.02)
    torque = JointTorqueSensor(noise=0.3, friction=friction)
    scene = Scene(robot=plain_ur5e(), base_wrench=None, joint_torque=torque)
    truth = CalibrationModel.of(scene)
    selected = entries(truth, ("bias", "coulomb", "viscous", "rotor"))
    free, squares = np.ones(len(selected), dtype=bool), []
    for seed in range(6):
        motion = FourierTrajectory.draw(np.random.default_rng(seed), CENTRE, np.full(6, 0.6), 5, 6.0)
        recording = simulate(scene, motion, seed + 50, RATE)
        found = trimmed_fit(truth, truth, [recording], selected, free)
        left, of_truth = (all_residuals(x, recording, scene.bandwidth) for x in (found.arm, truth))
        mean = uniform_filter1d(left - of_truth, round(WINDOW * RATE), axis=0)
        settled = settled_samples(recording, scene.bandwidth)
        squares.append((mean[settled:, :6] / found.uncertainty[0][settled:, :6]) ** 2)
    assert 0.5 < np.sqrt(np.mean(squares)) < 2.0


@pytest.mark.slow
def test_what_the_fit_does_not_determine_is_no_contact() -> None:
    """A stretch of this motion without contact was left out."""
    assert measure(33, base_sensor=False, touched=False).false_in_free == 0


def test_a_quiet_part_that_determines_nothing_leaves_the_fit_to_everything() -> None:
    scene = Scene(robot=plain_ur5e(), base_wrench=None, joint_torque=JointTorqueSensor(noise=0.3))
    motion = FourierTrajectory.draw(np.random.default_rng(1), CENTRE, np.full(6, 0.6), 5, 6.0)
    recording = simulate(scene, motion, 2, RATE)
    arm = CalibrationModel.of(scene)
    # The same parameters twice, with hardly any prior.
    selected = tuple(replace(x, prior_std=1e12) for x in 2 * entries(arm, ("bias", "viscous")))
    found = trimmed_fit(arm, arm, [recording], selected, np.ones(len(selected), dtype=bool))
    assert found.arm is arm
    assert not found.uncertainty[0].any()
