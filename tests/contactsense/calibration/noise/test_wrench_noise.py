"""The noise of force/torque sensors is that of their readings, whatever that of the velocities is."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense.benchmarks.calibration.simulate import simulate
from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.noise.wrench_noise import WrenchResiduals, wrench_noise, wrench_residuals
from contactsense.calibration.residuals.equations import all_residuals
from contactsense.calibration.residuals.recording_residuals import settled_samples
from contactsense.residuals.momentum_observer import noise_variance_ratio
from contactsense.sensors.settings import LEAST_NOISE
from tests.contactsense.calibration.test_link_sensors import TRUTH, motion

RATE = 250.0
RATIO = noise_variance_ratio(TRUTH.bandwidth, 1.0 / RATE)
ARM = CalibrationModel.of(TRUTH)
FIELDS = ("base_wrench", "link_wrenches.elbow", "wrist_wrench")


@pytest.fixture(scope="module")
def recording() -> FreeMotion:
    return simulate(TRUTH, motion(10.0), 1, RATE)


def residuals_of(recording: FreeMotion, field: str) -> WrenchResiduals:
    first = 6 + 6 * FIELDS.index(field)
    rows = np.arange(settled_samples(recording, TRUTH.bandwidth), len(recording.t) - 10)
    found = all_residuals(ARM, recording, TRUTH.bandwidth)[rows]
    return wrench_residuals(ARM, recording, rows, found[:, first : first + 6], field, TRUTH.bandwidth)


@pytest.mark.parametrize("field", FIELDS)
@pytest.mark.parametrize("velocity_noise", [0.0, 0.002])
def test_it_is_not_that_of_the_velocities(recording: FreeMotion, field: str, velocity_noise: float) -> None:
    chance = np.random.default_rng(2)
    noisy = replace(recording, qd=recording.qd + velocity_noise * chance.standard_normal(recording.qd.shape))
    parts = residuals_of(noisy, field)
    sensor = TRUTH.base_wrench if field == "base_wrench" else TRUTH.link_sensors[field]
    assert sensor is not None
    force, moment = wrench_noise([parts])
    assert force == pytest.approx(sensor.force_noise, rel=0.15)
    assert moment == pytest.approx(sensor.moment_noise, rel=0.15)
    # The residuals themselves have it, most that of the sensor that carries the whole arm.
    if velocity_noise and field == "base_wrench":
        assert np.sqrt(np.mean(parts.residual[:, 3:] ** 2) / RATIO) > 5.0 * sensor.moment_noise


def test_an_error_of_the_model_counts(recording: FreeMotion) -> None:
    """Forces that come and go slowly are no white noise of the readings, but the residual has them."""
    exact = residuals_of(recording, "base_wrench")
    slow = np.sin(0.5 * np.arange(len(exact.residual)) / RATE)[:, None]
    force, _ = wrench_noise([exact._replace(residual=exact.residual + 2.0 * slow)])
    assert force == pytest.approx(np.sqrt(2.0 / RATIO), rel=0.2)


def test_readings_without_noise_have_the_least_noise_that_a_scene_may_state() -> None:
    silent = np.zeros((100, 6))
    parts = [WrenchResiduals(silent, silent, silent, RATIO)]
    assert wrench_noise(parts) == (LEAST_NOISE, LEAST_NOISE)
