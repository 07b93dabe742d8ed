"""The place of a base sensor far from the base origin is found in recordings made by independent dynamics."""

import numpy as np
import pytest

from contactsense import Scene, WrenchSensor
from contactsense.benchmarks.calibration.simulate import simulate
from contactsense.calibration import Settings, calibrate
from contactsense.calibration.fourier_trajectory import FourierTrajectory
from tests.plain_arm import plain_ur5e

PLACE = (0.1, -0.05, -0.4)
SENSOR = WrenchSensor(force_noise=0.5, moment_noise=0.05, translation=PLACE, bias=(5, -3, 2, 0.3, 0.1, -0.2))
SCENE = Scene(robot=plain_ur5e(), joint_torque=None, base_wrench=SENSOR)


@pytest.mark.slow
def test_the_noise_of_the_forces_does_not_draw_it_to_the_base_origin() -> None:
    """It did, by three of the stated standard deviations in the mean: moments about the origin have the less
    noise the shorter the lever."""
    centre = np.array([0.0, -1.3, 1.5, -1.0, 0.8, 0.0])
    errors = []
    for seed in range(4):
        motion = FourierTrajectory.draw(np.random.default_rng(seed), centre, np.full(6, 0.6), 6, 15.0)
        recording = simulate(SCENE, motion, seed, 125.0)
        found = calibrate(SCENE, [recording], Settings(("wrench_bias", "shift")))
        (height,) = (value for value in found.values if value.entry.name == "shift z")
        errors.append(height.after / height.std)
    assert np.abs(np.mean(errors)) < 2.0
