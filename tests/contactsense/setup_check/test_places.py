"""Where a check finds a displaced base sensor."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import Scene, WrenchSensor
from contactsense.benchmarks.calibration.setup_draws import Settings, right_setup
from contactsense.benchmarks.calibration.simulate import simulate
from contactsense.calibration.motion.fourier_trajectory import FourierTrajectory
from contactsense.setup_check import check
from contactsense.setup_check.fit.fitter import Fitter
from contactsense.setup_check.result import FITS_BETTER
from contactsense.setup_check.setup import BASE, Free, Setup
from contactsense.setup_check.terms.motion_basis import MotionBases, Readings
from tests.plain_arm import plain_ur5e

_CENTRE = np.array([0.0, -1.3, 1.5, -1.0, 0.8, 0.0])


@pytest.mark.slow
@pytest.mark.parametrize("height", [-0.03, 0.03])
def test_the_noise_of_the_velocities_does_not_move_a_base_sensor(height: float) -> None:
    """Levers of the force by the model would, in this slow motion by 0.2 m: it has that noise, as the moments
    have."""
    stated = WrenchSensor(translation=(0.0, 0.0, -0.035))
    scene = Scene(robot=plain_ur5e(), joint_torque=None, base_wrench=stated)
    place = np.array([0.02, 0.0, -0.035 + height])
    moved = stated.model_copy(update={"translation": tuple(place.tolist())})
    motion = FourierTrajectory.draw(np.random.default_rng(1), _CENTRE, np.full(6, 0.3), 6, 60.0)
    exact = simulate(scene.model_copy(update={"base_wrench": moved}), motion, 1, 125.0)
    noise = 0.003 * np.random.default_rng(1).standard_normal(exact.qd.shape)
    recordings = [replace(exact, qd=exact.qd + noise)]
    bases = MotionBases({scene.robot.name: scene}, recordings)
    fitter = Fitter(scene, bases, Readings.of(scene, recordings))
    found = fitter.fit(Setup.of(scene), (Free("shift", BASE),))
    error = found.setup.sensors[BASE].translation - place
    assert np.abs(error / found.std).max() < 3.0
    assert found.std.max() < 0.03


@pytest.mark.slow
def test_a_small_displacement_is_shown_where_the_velocities_are_too_noisy_to_propose_it() -> None:
    """With the noise of a real arm's velocities, 12 s of slow motion are too short for 3 cm."""
    case = right_setup("ur5e", 2, Settings(seconds=12.0))
    sensor, motion = case.scene.base_wrench, case.recording
    assert sensor is not None
    x, y, z = sensor.translation
    stated = sensor.model_copy(update={"translation": (x, y, z + 0.03)})
    noise = 0.001 * np.random.default_rng(2).standard_normal(motion.qd.shape)
    recording = replace(motion, qd=motion.qd + noise)
    found = check(case.scene.model_copy(update={"base_wrench": stated}), [recording])
    assert found.fits
    (item,) = [item for item in found.findings if item.line == "base_wrench.translation"]
    assert (item.verdict, item.proposed) == ("cannot_tell", None)
    text, _, value = item.remark.partition(": ")
    assert text == FITS_BETTER
    np.testing.assert_allclose([float(number) for number in value[1:-1].split(",")], [x, y, z], atol=0.01)
