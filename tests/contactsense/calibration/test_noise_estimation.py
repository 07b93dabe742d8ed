"""Noise and model error of joint torques: what a factor on friction or the instants of the samples explain is
neither, and what grows with the inertia torque is told from what does not."""

import numpy as np
import pytest

from contactsense.calibration.noise_estimation import JointResiduals, NoiseLevels, estimate_noise
from contactsense.residuals.momentum_observer import noise_variance_ratio

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
        recordings.append(JointResiduals(row * friction + noise, qd, friction, nothing, nothing))
    return estimate_noise(recordings, DT, RATIO)


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
        parts.append(JointResiduals(residual, qd, np.zeros(qd.shape), stated, inertia_torque))
    return estimate_noise(parts, DT, RATIO)


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
    found = estimate_noise([JointResiduals(residual, qd, nothing, nothing, nothing)], DT, RATIO)
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
        parts.append(JointResiduals(residual, qd, nothing, nothing, torque))
    found = estimate_noise(parts, DT, RATIO)
    residual, qd = np.vstack([p.residual for p in parts]), np.abs(np.vstack([p.qd for p in parts]))
    torque = np.vstack([p.inertia_torque for p in parts])
    std = np.sqrt(found.noise**2 * RATIO + found.model_error**2 + (found.inertia_torque_error * torque) ** 2)
    for j in range(2):
        moving = qd[:, j] > 3.0 * found.rest_velocity
        beyond = np.mean(np.abs(residual[moving, j]) > 3.29 * std[moving, j])
        assert beyond == pytest.approx(1e-3, abs=2e-4)
