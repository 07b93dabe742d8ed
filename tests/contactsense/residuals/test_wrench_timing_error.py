"""The covariance of a wrench's residual due to the noise of velocities and their instants."""

import math

import numpy as np
import pytest

from contactsense.detection.false_alarm_rate import onset_threshold
from contactsense.residuals.momentum_observer import (
    advance_all,
    empty_observer,
    noise_variance_ratio,
    start_step,
)
from contactsense.residuals.wrench_timing_error import WrenchTimingError, advance_wrench_timing_error
from contactsense.robots.jit.flat_buffers import zeros

BANDWIDTH = 10.0
K = 2.0 * math.pi * BANDWIDTH
VARIANCES = (0.25**2, 0.05**2)
NO_STEP = -1.0


def covariances(momentum: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """After each sample, shape (N, 6, 6), for momenta (N, 6)."""
    state = zeros(WrenchTimingError)
    found = []
    for h, dt in zip(momentum, steps.tolist(), strict=True):
        advance_wrench_timing_error(state, h, VARIANCES, dt, BANDWIDTH)
        found.append(state.covariance.copy())
    return np.array(found)


def even(samples: int, dt: float) -> np.ndarray:
    """Steps of a stream."""
    return np.where(np.arange(samples) == 0, 0.0, dt)


def test_steady_motion_and_acceleration_have_no_error() -> None:
    t = 0.01 * np.arange(100)
    slope = np.array([3.0, -1.0, 0.5, 0.2, 0.1, -0.4])
    for momentum in (np.tile(slope, (100, 1)), np.outer(t, slope)):
        assert np.abs(covariances(momentum, even(100, 0.01))).max() < 1e-15


@pytest.mark.parametrize("dt", [0.002, 0.008])
@pytest.mark.parametrize("jitter", [0.0, 0.4])
def test_noise_is_as_large_as_stated(dt: float, jitter: float) -> None:
    """White noise of a few velocities, of different directions: in each, the standard deviation of the
    residuals of the momentum observer is the stated one, or less, but not less than half of it."""
    chance = np.random.default_rng(0)
    n = 6000
    columns = chance.standard_normal((3, 6)) * [0.01, 0.01, 0.01, 0.004, 0.004, 0.004]
    momentum = chance.standard_normal((n, 3)) @ columns
    steps = even(n, 1.0) * dt * (1.0 + jitter * chance.uniform(-1.0, 1.0, n))
    observer, residuals = empty_observer(6), []
    for h, step in zip(momentum, steps.tolist(), strict=True):
        advance_all(observer, h, np.zeros(6), start_step(observer, step, BANDWIDTH))
        residuals.append(observer.residual.copy())
    settled = slice(500, None)
    stated = covariances(momentum, steps)[settled].mean(axis=0)
    measured = np.cov(np.array(residuals)[settled].T, bias=True)
    # In the span of the noise's three directions, in each of which the two are compared.
    basis = np.linalg.svd(columns)[2][:3]
    ratio = np.linalg.eigvals(np.linalg.solve(basis @ stated @ basis.T, basis @ measured @ basis.T)).real
    assert (ratio < 1.05).all()
    assert (ratio > 0.25).all()


@pytest.mark.parametrize("joints", [1, 6])
def test_the_first_noise_after_rest_is_no_onset(joints: int) -> None:
    """From the first sample with noise on, which is in the span of as many columns as joints move: the energy
    is never above the onset threshold in two samples in a row."""
    chance, dt = np.random.default_rng(1), 0.002
    threshold = onset_threshold(0.01, 6, BANDWIDTH, dt)
    sensor = noise_variance_ratio(BANDWIDTH, dt) * np.diag(np.repeat(VARIANCES, 3))
    for _ in range(100):
        columns = chance.standard_normal((joints, 6)) * [0.01, 0.01, 0.01, 0.002, 0.002, 0.002]
        momentum = np.vstack((np.zeros((20, 6)), chance.standard_normal((30, joints)) @ columns))
        observer, steps = empty_observer(6), even(50, dt)
        stated, energy = covariances(momentum, steps), []
        for h, step, covariance in zip(momentum, steps.tolist(), stated, strict=True):
            advance_all(observer, h, np.zeros(6), start_step(observer, step, BANDWIDTH))
            r = observer.residual
            energy.append(0.5 * r @ np.linalg.solve(covariance + sensor, r))
        above = np.array(energy) > threshold
        assert not (above[1:] & above[:-1]).any()


def test_a_jump_of_the_acceleration_is_covered_in_its_direction_and_forgotten() -> None:
    dt, jump = 0.002, np.array([8.0, -3.0, 1.0, 2.0, 1.0, -0.5])
    t = dt * np.arange(400)
    momentum = np.outer(np.maximum(t - 0.2, 0.0), jump)
    found = covariances(momentum, even(400, dt))
    at = 1 + int(np.argmax(found[:, 0, 0] > 0.0))
    # Along the jump the error of half an interval is within two standard deviations.
    error = K * 0.5 * dt * jump
    assert 0.5 * error @ np.linalg.solve(found[at] + 1e-9 * np.eye(6), error) < 0.5 * 2.0**2
    across = np.array([3.0, 8.0, 0.0, 0.0, 0.0, 0.0]) / np.hypot(3.0, 8.0)
    along = jump / np.linalg.norm(jump)
    assert along @ found[at] @ along > 2.0 * across @ found[at] @ across
    assert found[-1, 0, 0] < 1e-2 * found[at, 0, 0]


def test_it_is_kept_without_a_wrench_and_forgotten_at_a_restart() -> None:
    chance, state = np.random.default_rng(2), zeros(WrenchTimingError)
    for i in range(20):
        advance_wrench_timing_error(
            state, chance.standard_normal(6), VARIANCES, 0.002 if i else 0.0, BANDWIDTH
        )
    before = state.covariance.copy()
    assert before[0, 0] > 0.0
    state.covariance[:] = 0.0  # as a single measurement between two samples leaves it
    advance_wrench_timing_error(state, np.full(6, np.nan), VARIANCES, NO_STEP, BANDWIDTH)
    np.testing.assert_allclose(state.covariance, before, rtol=1e-12)
    for samples in range(3):
        advance_wrench_timing_error(state, np.zeros(6), VARIANCES, 0.002 if samples else 0.0, BANDWIDTH)
        assert not state.covariance.any()


def test_a_gap_does_not_make_noise() -> None:
    """A long step has a small error of the rate, a short one before it a large one."""
    chance = np.random.default_rng(3)
    momentum = 0.01 * chance.standard_normal((400, 6))
    steps = even(400, 0.002)
    largest = covariances(momentum, steps)[:, 0, 0].max()
    for gap in (0.004, 0.02, 0.5):
        steps[200] = gap
        assert covariances(momentum, steps)[200:, 0, 0].max() < 1.2 * largest
