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
from contactsense.residuals.velocity_noise import VelocityNoise, follow_velocity_noise
from contactsense.residuals.wrench_velocity_error import (
    CORRELATION_TIME,
    WrenchVelocityError,
    advance_wrench_velocity_error,
    noise_share_in_average,
)
from contactsense.robots.jit.flat_buffers import zeros

BANDWIDTH = 10.0
K = 2.0 * math.pi * BANDWIDTH
VARIANCES = (0.25**2, 0.05**2)
NO_STEP = -1.0


def covariances(
    velocity: np.ndarray, columns: np.ndarray, steps: np.ndarray, wrench_steps: np.ndarray | None = None
) -> np.ndarray:
    """After each sample, shape (N, 6, 6), for velocities (N, n) and momenta of unit velocities (n, 6)."""
    joints = velocity.shape[1]
    velocities, state = zeros(VelocityNoise, joints=joints), zeros(WrenchVelocityError, joints=joints)
    state.unit_momentum[:] = columns
    found = []
    for qd, dt, own in zip(
        velocity, steps.tolist(), (steps if wrench_steps is None else wrench_steps).tolist(), strict=True
    ):
        follow_velocity_noise(velocities, qd, dt)
        advance_wrench_velocity_error(state, velocities, own, BANDWIDTH)
        found.append(state.noise + state.instants)
    return np.array(found)


def even(samples: int, dt: float) -> np.ndarray:
    """Steps of a stream."""
    return np.where(np.arange(samples) == 0, 0.0, dt)


def residuals_of(momentum: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Of the momentum observer, shape (N, 6), without any wrench."""
    observer, residuals = empty_observer(6), []
    for h, step in zip(momentum, steps.tolist(), strict=True):
        advance_all(observer, h, np.zeros(6), start_step(observer, step, BANDWIDTH))
        residuals.append(observer.residual.copy())
    return np.array(residuals)


def test_in_steady_motion_the_error_vanishes() -> None:
    t = 0.01 * np.arange(300)
    columns = np.random.default_rng(0).standard_normal((2, 6))
    for velocity in (np.full((300, 2), 0.7), np.stack((0.3 * t, 1.0 - 0.1 * t), axis=1)):
        assert np.abs(covariances(velocity, columns, even(300, 0.01))[-1]).max() < 1e-12


@pytest.mark.parametrize("dt", [0.002, 0.008])
@pytest.mark.parametrize("jitter", [0.0, 0.4])
def test_noise_is_as_large_as_stated(dt: float, jitter: float) -> None:
    """White noise of a few velocities: in each direction in which it moves the momentum, the standard
    deviation of the momentum observer's residuals is the stated one, or less, but not less than two thirds of
    it."""
    chance = np.random.default_rng(0)
    n = 6000
    columns = chance.standard_normal((3, 6)) * [10.0, 10.0, 10.0, 4.0, 4.0, 4.0]
    velocity = 0.4 + 0.001 * chance.standard_normal((n, 3))
    steps = even(n, 1.0) * dt * (1.0 + jitter * chance.uniform(-1.0, 1.0, n))
    settled = slice(500, None)
    stated = covariances(velocity, columns, steps)[settled].mean(axis=0)
    measured = np.cov(residuals_of((velocity - 0.4) @ columns, steps)[settled].T, bias=True)
    # In the span of the noise's three directions, in each of which the two are compared.
    basis = np.linalg.svd(columns)[2][:3]
    ratio = np.linalg.eigvals(np.linalg.solve(basis @ stated @ basis.T, basis @ measured @ basis.T)).real
    assert (ratio < 1.05).all()
    assert (ratio > 0.45).all()


@pytest.mark.parametrize("deviation", [0.0002, 0.001, 0.005])
@pytest.mark.parametrize("joints", [1, 6])
def test_the_first_noise_after_rest_is_no_onset(joints: int, deviation: float) -> None:
    """From the first sample with noise on, which is in the span of as many columns as joints move: the energy
    is never above the onset threshold in two samples in a row."""
    chance, dt = np.random.default_rng(1), 0.002
    threshold = onset_threshold(0.01, 6, BANDWIDTH, dt)
    sensor = noise_variance_ratio(BANDWIDTH, dt) * np.diag(np.repeat(VARIANCES, 3))
    for _ in range(100):
        columns = chance.standard_normal((joints, 6)) * [10.0, 10.0, 10.0, 2.0, 2.0, 2.0]
        velocity = np.vstack((np.zeros((20, joints)), deviation * chance.standard_normal((30, joints))))
        steps, energy = even(50, dt), []
        stated, residuals = covariances(velocity, columns, steps), residuals_of(velocity @ columns, steps)
        for covariance, r in zip(stated, residuals, strict=True):
            energy.append(0.5 * r @ np.linalg.solve(covariance + sensor, r))
        above = np.array(energy) > threshold
        assert not (above[1:] & above[:-1]).any()


def test_a_jump_of_an_acceleration_is_covered_in_its_direction_and_forgotten() -> None:
    dt, jump = 0.002, np.array([8.0, -3.0, 1.0, 2.0, 1.0, -0.5])
    t = dt * np.arange(400)
    velocity = 0.1 + 10.0 * np.maximum(t - 0.2, 0.0)
    found = covariances(velocity[:, None], jump[None] / 10.0, even(400, dt))
    at = int(np.argmax(t > 0.2 + 1e-9))
    # Along the jump the error of half an interval is within two standard deviations.
    error = K * 0.5 * dt * jump
    assert 0.5 * error @ np.linalg.solve(found[at] + 1e-9 * np.eye(6), error) < 0.5 * 2.0**2
    across = np.array([3.0, 8.0, 0.0, 0.0, 0.0, 0.0]) / np.hypot(3.0, 8.0)
    along = jump / np.linalg.norm(jump)
    assert along @ found[at] @ along > 2.0 * across @ found[at] @ across
    assert found[-1, 0, 0] < 1e-2 * found[at, 0, 0]
    assert not covariances(np.vstack((velocity[:, None], np.zeros((600, 1)))), jump[None], even(1000, dt))[
        -1
    ].any()


def test_a_slower_sensor_has_the_change_of_its_own_interval() -> None:
    """A wrench every 8 ms may be 8 ms old, whenever within them the acceleration has changed."""
    dt, column = 0.002, np.array([[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]])
    t = dt * np.arange(400)
    velocity = (0.1 + 30.0 * np.maximum(t - 0.2, 0.0))[:, None]
    own = np.where(np.arange(400) % 4 == 0, even(400, 4.0 * dt), NO_STEP)
    slow = covariances(velocity, column, even(400, dt), own)[:, 0, 0].max()
    error = K * 0.5 * 4.0 * dt * 30.0
    assert error < 2.0 * math.sqrt(slow)


def test_it_is_kept_without_a_wrench_and_forgotten_at_a_restart() -> None:
    chance = np.random.default_rng(2)
    velocities, state = zeros(VelocityNoise, joints=1), zeros(WrenchVelocityError, joints=1)
    state.unit_momentum[:] = 10.0
    for i in range(20):
        follow_velocity_noise(velocities, 0.01 * chance.standard_normal(1), 0.002 if i else 0.0)
        advance_wrench_velocity_error(state, velocities, 0.002 if i else 0.0, BANDWIDTH)
    before = state.noise + state.instants
    assert before[0, 0] > 0.0
    # As a single measurement between two samples leaves it.
    state.noise[:], state.instants[:] = 0.0, 0.0
    velocities.history[0].due, velocities.history[0].changes = False, False
    advance_wrench_velocity_error(state, velocities, NO_STEP, BANDWIDTH)
    np.testing.assert_allclose(state.noise + state.instants, before, rtol=1e-12)
    for samples in range(3):
        follow_velocity_noise(velocities, np.zeros(1), 0.002 if samples else 0.0)
        advance_wrench_velocity_error(state, velocities, 0.002 if samples else 0.0, BANDWIDTH)
        assert not state.instants.any()
    assert not state.noise.any()


def test_a_gap_does_not_make_noise() -> None:
    """A long step has a small error of the rate, a short one before it a large one."""
    chance = np.random.default_rng(3)
    velocity, column = 0.001 * chance.standard_normal((400, 6)), 10.0 * np.eye(6)
    steps = even(400, 0.002)
    largest = covariances(velocity, column, steps)[100:, 0, 0].max()
    for gap in (0.004, 0.02, 0.5):
        steps[200] = gap
        assert covariances(velocity, column, steps)[200:, 0, 0].max() < 1.3 * largest


@pytest.mark.parametrize("duration", [0.05, 0.2, 1.0])
def test_in_an_average_noise_is_less_than_that_of_the_sensor(duration: float) -> None:
    """White velocity noise in the mean of the residuals over a time: no more than stated, though the share of
    the sensor's low-passed noise is several times as large."""
    chance, dt = np.random.default_rng(4), 0.002
    n = round(duration / dt)
    velocity = 0.4 + 0.001 * chance.standard_normal((200 * n + 500, 1))
    steps = even(len(velocity), dt)
    residual = residuals_of((velocity - 0.4) @ np.full((1, 6), 10.0), steps)[500:, 0]
    measured = residual.reshape(200, n).mean(axis=1).var() / residual.var()
    low_passed = 2.0 / (K * duration)
    stated = noise_share_in_average(min(low_passed, 1.0), BANDWIDTH)
    assert measured < stated
    assert noise_share_in_average(1.0, BANDWIDTH) == 1.0
    assert noise_share_in_average(0.1, BANDWIDTH) < 0.4 * 0.1


@pytest.mark.parametrize("duration", [0.02, 0.2])
def test_in_an_average_noise_correlated_for_the_stated_time_is_as_large_as_stated(duration: float) -> None:
    chance, dt = np.random.default_rng(6), 0.0005
    kept, weight = math.exp(-dt / CORRELATION_TIME), -math.expm1(-dt / duration)
    white = chance.standard_normal((4000, 500))
    noise, average, variances = white[0], np.zeros(500), []
    for step in white[1:]:
        noise = kept * noise + math.sqrt(1.0 - kept**2) * step
        average += weight * (noise - average)
        variances.append(np.mean(average**2))
    low_passed = 1.0 / (1.0 + K * duration)
    expected = np.mean(variances[2500:])
    assert noise_share_in_average(low_passed, BANDWIDTH) == pytest.approx(expected, rel=0.1)
    # Low-passed by an observer whose time constant is shorter than that correlation, it has that share.
    assert noise_share_in_average(0.3, 100.0) == pytest.approx(0.3)


@pytest.mark.parametrize("every", [2, 4, 8])
@pytest.mark.parametrize("joints", [1, 6])
def test_the_noise_of_a_slower_sensor_is_not_overstated(joints: int, every: int) -> None:
    """As little as for one with a value in each sample: its step is longer than that of the velocities."""
    chance, n, dt = np.random.default_rng(5), 6000, 0.002
    columns = chance.standard_normal((joints, 6)) * [10.0, 10.0, 10.0, 4.0, 4.0, 4.0]
    velocity = 0.4 + 0.001 * chance.standard_normal((n, joints))
    own = np.where(np.arange(n) % every == 0, even(n, every * dt), NO_STEP)
    stated = covariances(velocity, columns, even(n, dt), own)[1000:].mean(axis=0)
    residuals = residuals_of((velocity[::every] - 0.4) @ columns, even(n // every, every * dt))[100:]
    ratio = np.trace(stated) / np.trace(np.cov(residuals.T))
    assert 1.0 < ratio < 2.3


def test_a_missed_wrench_lets_the_next_one_have_the_change_of_both_steps() -> None:
    dt, column = 0.002, np.array([[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]])
    t = dt * np.arange(200)
    velocity = (0.1 + 30.0 * np.maximum(t - 0.2, 0.0))[:, None]
    own, at = even(200, dt), int(np.argmax(t > 0.2 + 1e-9))
    own[at], own[at + 1] = NO_STEP, 2.0 * dt
    missed = covariances(velocity, column, even(200, dt), own)
    assert missed[at, 0, 0] < 1e-3
    assert missed[at + 1, 0, 0] == pytest.approx((K * 2.0 * dt * 30.0) ** 2 / 12.0, rel=1e-2)
    # That acceleration lasts.
    assert missed[at + 2, 0, 0] == pytest.approx(math.exp(-2.0 * K * dt) * missed[at + 1, 0, 0], rel=1e-2)


@pytest.mark.parametrize("deviation", [0.001, 0.005])
@pytest.mark.parametrize("every", [1, 4, 8])
def test_the_last_noise_before_rest_is_no_onset(every: int, deviation: float) -> None:
    """The observer's integral has noise from before, and so has the last value of a slower sensor: the energy
    is never above the onset threshold in two values in a row."""
    chance, dt, n = np.random.default_rng(7), 0.002, 480
    threshold = onset_threshold(0.01, 6, BANDWIDTH, every * dt)
    sensor = noise_variance_ratio(BANDWIDTH, every * dt) * np.diag(np.repeat(VARIANCES, 3))
    own = np.where(np.arange(n) % every == 0, even(n, every * dt), NO_STEP)
    for trial in range(60):
        columns = chance.standard_normal((6, 6)) * [10.0, 10.0, 10.0, 2.0, 2.0, 2.0]
        velocity = deviation * chance.standard_normal((n, 6))
        velocity[400 + trial % 8 :] = 0.0
        stated = covariances(velocity, columns, even(n, dt), own)[::every]
        residuals = residuals_of((velocity @ columns)[::every], even(n // every, every * dt))
        energy = [0.5 * r @ np.linalg.solve(C + sensor, r) for C, r in zip(stated, residuals, strict=True)]
        above = np.array(energy)[390 // every :] > threshold
        assert not (above[1:] & above[:-1]).any()
