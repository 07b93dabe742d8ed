"""Noise and model error of joint torques: what a factor on friction explains is neither."""

import numpy as np

from contactsense.calibration.noise_estimation import NoiseLevels, estimate_noise
from contactsense.residuals.momentum_observer import noise_variance_ratio

DT, BANDWIDTH, NOISE, FRICTION = 0.01, 10.0, 0.5, 8.0
RATIO = noise_variance_ratio(BANDWIDTH, DT)


def _estimate(factors: np.ndarray) -> NoiseLevels:
    """From a recording for each row of `factors`, relative changes of friction, shape (R, 2); the second of
    two joints has no friction."""
    chance, residuals, velocities, frictions = np.random.default_rng(1), [], [], []
    for row in factors:
        qd = np.stack([np.sin(0.7 * DT * np.arange(4000)), np.cos(0.9 * DT * np.arange(4000))], axis=1)
        friction = FRICTION * np.sign(qd) * (1.0, 0.0)
        noise = NOISE * np.sqrt(RATIO) * chance.standard_normal(qd.shape)
        residuals.append(row * friction + noise)
        velocities.append(qd)
        frictions.append(friction)
    return estimate_noise(residuals, velocities, frictions, DT, RATIO)


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
