"""Noise and model error of joint torques: what a factor on friction or the instants of the samples explain is
neither, and what grows with the inertia torque is told from what does not."""

import numpy as np
import pytest
from scipy.linalg import toeplitz

from contactsense.calibration.noise import noise_estimation
from contactsense.calibration.noise.noise_estimation import JointResiduals, NoiseLevels, estimate_noise
from contactsense.residuals.momentum_observer import noise_variance_ratio
from contactsense.residuals.residual_ewma import RELATIVE_BANDWIDTH

DT, BANDWIDTH, NOISE, FRICTION = 0.01, 10.0, 0.5, 8.0
RATIO = noise_variance_ratio(BANDWIDTH, DT)
SAMPLES = 4000


def _estimate(factors: np.ndarray) -> NoiseLevels:
    """From a recording for each row of `factors`, relative changes of friction, shape (R, 2); the second of
    two joints has no friction."""
    chance, recordings = np.random.default_rng(1), []
    for row in factors:
        qd = _velocities()
        friction = FRICTION * np.sign(qd) * (1.0, 0.0)
        noise = NOISE * np.sqrt(RATIO) * chance.standard_normal(qd.shape)
        nothing = np.zeros(qd.shape)
        recordings.append(JointResiduals(row * friction + noise, qd, friction, nothing, nothing, DT))
    return estimate_noise(recordings, BANDWIDTH)


def _velocities() -> np.ndarray:
    t = DT * np.arange(SAMPLES)
    return np.stack([np.sin(0.7 * t), np.cos(0.9 * t)], axis=1)


def _of_errors(
    constant: float, relative: float, timing_variance: np.ndarray, seed: int, known: bool = True
) -> NoiseLevels:
    """From Gaussian residuals with that error in any motion [Nm] and in proportion to the inertia torque, and
    with a variance due to the instants of the samples, which is known or not, shape (N,) [Nm^2]."""
    chance, parts = np.random.default_rng(seed), []
    for _ in range(4):
        qd = _velocities()
        inertia_torque = 10.0 * np.cumsum(0.1 * chance.standard_normal(qd.shape), axis=0)
        variance = (
            NOISE**2 * RATIO + constant**2 + (relative * inertia_torque) ** 2 + timing_variance[:, None]
        )
        residual = np.sqrt(variance) * chance.standard_normal(qd.shape)
        stated = np.broadcast_to(timing_variance[:, None] * known, qd.shape)
        parts.append(JointResiduals(residual, qd, np.zeros(qd.shape), stated, inertia_torque, DT))
    return estimate_noise(parts, BANDWIDTH)


def test_a_factor_is_no_model_error() -> None:
    found = _estimate(np.array([[0.1, 0.0], [-0.1, 0.0], [0.05, 0.0], [-0.05, 0.0]]))
    np.testing.assert_allclose(found.noise, NOISE, rtol=0.05)
    # Friction differs by up to 0.8 Nm from one recording to the next.
    assert found.model_error[0] < 0.15
    # Four recordings and the prior of 0.1, which counts as two.
    np.testing.assert_allclose(found.friction_error[0], np.sqrt((0.025 + 0.02) / 5), rtol=0.02)


def test_a_joint_without_friction_has_no_error_of_it() -> None:
    found = _estimate(np.array([[0.1, 0.0], [-0.1, 0.0]]))
    assert found.friction_error[1] == 0.0
    assert np.isfinite(found.model_error).all()


def test_a_signal_without_inertia_has_no_error_of_it() -> None:
    found = _estimate(np.array([[0.1, 0.0], [-0.1, 0.0]]))
    np.testing.assert_array_equal(found.inertia_torque_error, 0.0)


def test_an_error_in_proportion_to_the_inertia_torque_is_recovered() -> None:
    found = _of_errors(0.05, 0.1, np.zeros(SAMPLES), seed=5)
    np.testing.assert_allclose(found.inertia_torque_error, 0.1, rtol=0.25)


def test_an_error_that_does_not_grow_is_not_blamed_on_inertia() -> None:
    found = _of_errors(1.0, 0.0, np.zeros(SAMPLES), seed=6)
    # The noise is that of the fast part, which here contains the error: together they are what was put in.
    total = np.sqrt(found.noise**2 * RATIO + found.model_error**2)
    np.testing.assert_allclose(total, np.sqrt(NOISE**2 * RATIO + 1.0), rtol=0.1)
    assert found.inertia_torque_error.max() < 0.02


def test_the_instants_of_the_samples_are_no_model_error() -> None:
    """In one sample of 50 they cause 3 Nm, as a hard stop does."""
    timing = np.where(np.arange(SAMPLES) % 50 == 0, 9.0, 0.0)
    known = _of_errors(0.2, 0.0, timing, seed=7)
    unknown = _of_errors(0.2, 0.0, timing, seed=7, known=False)
    assert known.model_error.max() < 0.6
    assert unknown.model_error.min() > 1.0


def test_an_error_at_rest_is_not_underestimated() -> None:
    """For joints that are at rest, or nearly, for half of the time."""
    rest_error, velocity, chance = 2.0, 0.05, np.random.default_rng(9)
    qd, half = _velocities(), SAMPLES // 2
    qd[:half] = 0.5 * velocity * np.sin(0.7 * DT * np.arange(half))[:, None]
    drift = np.repeat(chance.standard_normal((SAMPLES // 100, 2)), 100, axis=0)
    error = rest_error / (1.0 + (qd / velocity) ** 2) * drift
    residual = NOISE * np.sqrt(RATIO) * chance.standard_normal(qd.shape) + error
    nothing = np.zeros(qd.shape)
    found = estimate_noise([JointResiduals(residual, qd, nothing, nothing, nothing, DT)], BANDWIDTH)
    assert found.rest_velocity == velocity
    assert (found.rest_error > rest_error).all()
    assert (found.rest_error < 1.5 * rest_error).all()
    assert (found.model_error < 0.2).all()


@pytest.mark.parametrize("relative", [0.0, 0.1, 0.3])
def test_one_residual_in_a_thousand_exceeds_3_29_standard_deviations(relative: float) -> None:
    """Also where the tail is heavier than that of a Gaussian: Student's t of four degrees of freedom."""
    chance, parts = np.random.default_rng(8), []
    for _ in range(4):
        qd = _velocities()
        torque = 8.0 * np.sin(1.3 * DT * np.arange(SAMPLES))[:, None] * np.ones((1, 2))
        residual = chance.standard_t(4, qd.shape) * np.hypot(0.3, relative * torque)
        nothing = np.zeros(qd.shape)
        parts.append(JointResiduals(residual, qd, nothing, nothing, torque, DT))
    found = estimate_noise(parts, BANDWIDTH)
    residual, qd = np.vstack([p.residual for p in parts]), np.abs(np.vstack([p.qd for p in parts]))
    torque = np.vstack([p.inertia_torque for p in parts])
    std = np.sqrt(found.noise**2 * RATIO + found.model_error**2 + (found.inertia_torque_error * torque) ** 2)
    for j in range(2):
        moving = qd[:, j] > 3.0 * found.rest_velocity
        beyond = np.mean(np.abs(residual[moving, j]) > 3.29 * std[moving, j])
        assert beyond == pytest.approx(1e-3, abs=2e-4)


def _averages(residual: np.ndarray) -> np.ndarray:
    """EWMA of residuals, sample by sample, from the first one on."""
    weight, averages = 1.0 - np.exp(-2.0 * np.pi * RELATIVE_BANDWIDTH * BANDWIDTH * DT), [residual[0]]
    for row in residual[1:]:
        averages.append(averages[-1] + weight * (row - averages[-1]))
    return np.array(averages)


def test_the_noise_of_an_average_is_that_of_its_weights() -> None:
    """Each recording begins its own average."""
    chance = np.random.default_rng(12)
    parts = [level + chance.standard_normal((300, 2)) for level in (5.0, -3.0)]
    averages, variance = noise_estimation._averages(parts, [DT, DT], BANDWIDTH)
    np.testing.assert_allclose(averages, np.vstack([_averages(part) for part in parts]))
    K, k = 2.0 * np.pi * BANDWIDTH, np.arange(1000)
    weights = -np.expm1(-RELATIVE_BANDWIDTH * K * DT) * np.exp(-RELATIVE_BANDWIDTH * K * DT * k)
    expected = weights @ toeplitz(np.exp(-K * DT * k)) @ weights
    np.testing.assert_allclose(variance, np.full((600, 1), expected))


def _filtered_noise(chance: np.random.Generator, cut_off: float) -> np.ndarray:
    """An Ornstein-Uhlenbeck process of unit variance and that cut-off frequency [Hz], shape (SAMPLES, 2)."""
    keep = np.exp(-2.0 * np.pi * cut_off * DT)
    rows = [chance.standard_normal(2)]
    for _ in range(SAMPLES - 1):
        rows.append(keep * rows[-1] + np.sqrt(1.0 - keep**2) * chance.standard_normal(2))
    return np.array(rows)


def _with_error(cut_off: float, error: float) -> tuple[np.ndarray, NoiseLevels]:
    """Residuals of noise and an error of that cut-off frequency [Hz] and standard deviation [Nm], shape
    (6 * SAMPLES, 2), and what is estimated from them."""
    chance, parts = np.random.default_rng(10), []
    for _ in range(6):
        residual = NOISE * np.sqrt(RATIO) * _filtered_noise(chance, BANDWIDTH)
        residual += error * _filtered_noise(chance, cut_off)
        nothing = np.zeros(residual.shape)
        parts.append(JointResiduals(residual, _velocities(), nothing, nothing, nothing, DT))
    return np.vstack([part.residual for part in parts]), estimate_noise(parts, BANDWIDTH)


@pytest.mark.parametrize("cut_off", [0.02, 0.5, 2.0, 6.0])
def test_one_average_in_a_thousand_exceeds_3_29_standard_deviations(cut_off: float) -> None:
    """Also where a part of the error is so fast that it counts as noise, but averages out less than noise."""
    residual, found = _with_error(cut_off, 1.5)
    # Of white noise through the observer: sampled, it is 0.174 instead of 0.167 of the variance.
    white = RELATIVE_BANDWIDTH / (1.0 + RELATIVE_BANDWIDTH)
    speed = np.abs(np.tile(_velocities(), (6, 1)))
    model = found.model_variance(speed, np.zeros(speed.shape))
    std = np.sqrt(found.noise**2 * RATIO * white + found.average_error**2 * model)
    averages = np.vstack([_averages(part) for part in np.split(residual, 6)])
    assert (np.mean(np.abs(averages) > 3.29 * std, axis=0) < 1.3e-3).all()


def test_a_slow_error_does_not_average_out() -> None:
    _, found = _with_error(0.02, 1.5)
    np.testing.assert_allclose(found.average_error, 1.0, atol=0.1)


def test_no_error_averages_out_better_than_noise() -> None:
    _, found = _with_error(BANDWIDTH, 1.5)
    assert (found.average_error > np.sqrt(RELATIVE_BANDWIDTH / (1.0 + RELATIVE_BANDWIDTH))).all()


def test_too_few_samples_tell_nothing_about_averages() -> None:
    qd = _velocities()[:150]
    residual = np.random.default_rng(11).standard_normal(qd.shape)
    nothing = np.zeros(qd.shape)
    found = estimate_noise([JointResiduals(residual, qd, nothing, nothing, nothing, DT)], BANDWIDTH)
    np.testing.assert_array_equal(found.average_error, 1.0)
