"""Where a check finds a displaced base sensor."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import Scene, WrenchSensor
from contactsense.benchmarks.calibration.setup_draws import Settings, right_setup
from contactsense.benchmarks.calibration.simulate import simulate
from contactsense.calibration.motion.fourier_trajectory import FourierTrajectory
from contactsense.setup_check import SetupCheck, check
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


def _displaced(height: float, noise: float) -> tuple[SetupCheck, np.ndarray]:
    """What a check says of a base sensor that is stated too high, by 12 s of slow motion with noisy
    velocities, and its true place."""
    case = right_setup("ur5e", 2, Settings(seconds=12.0))
    sensor, motion = case.scene.base_wrench, case.recording
    assert sensor is not None
    place = np.array(sensor.translation)
    stated = sensor.model_copy(update={"translation": tuple((place + np.array([0.0, 0.0, height])).tolist())})
    noisy = motion.qd + noise * np.random.default_rng(2).standard_normal(motion.qd.shape)
    scene = case.scene.model_copy(update={"base_wrench": stated})
    return check(scene, [replace(motion, qd=noisy)]), place


def _place(text: str) -> list[float]:
    return [float(number) for number in text.strip("[]").split(", ")]


@pytest.mark.slow
def test_a_small_displacement_is_found_beside_noisy_velocities() -> None:
    """The noise of a real arm's velocities averages out."""
    found, place = _displaced(0.03, 0.002)
    (item,) = found.wrong
    assert item.line == "base_wrench.translation"
    assert item.proposed is not None
    np.testing.assert_allclose(_place(item.proposed), place, atol=0.01)


@pytest.mark.slow
def test_a_place_that_fits_better_though_not_clearly_is_shown() -> None:
    found, place = _displaced(0.014, 0.003)
    assert found.fits
    (item,) = [item for item in found.findings if item.line == "base_wrench.translation"]
    assert (item.verdict, item.proposed) == ("cannot_tell", None)
    remark, _, value = item.remark.partition(": ")
    assert remark == FITS_BETTER
    np.testing.assert_allclose(_place(value), place, atol=0.01)
