"""The variance of a residual due to the unknown instants of velocities within the sample interval."""

import numpy as np
import pytest

from contactsense.residuals.momentum_observer import advance, empty_observer, start_step
from contactsense.residuals.timing_error import TimingError, advance_timing_error
from contactsense.robots.jit.flat_buffers import zeros

BANDWIDTH = 10.0
NO_STEP = -1.0


def _variance(momentum: np.ndarray, dt: float) -> np.ndarray:
    state = zeros(TimingError, joints=1)
    variances = []
    for i, h in enumerate(momentum):
        advance_timing_error(state, np.array([h]), dt if i else 0.0, BANDWIDTH)
        variances.append(state.variance[0])
    return np.array(variances)


def test_steady_motion_and_acceleration_have_no_error() -> None:
    t = 0.01 * np.arange(100)
    for momentum in (np.full(100, 7.0), 3.0 * t):
        assert _variance(momentum, 0.01).max() < 1e-20


def test_it_is_as_large_as_the_error_of_velocities_at_unknown_instants() -> None:
    """A body brakes within 60 ms, and each velocity is that of some instant in its sample interval: residuals
    of the momentum observer, which would be zero, are as large as stated, to a third."""
    dt, deceleration, brakes, duration = 0.01, 100.0, 1.0, 0.06
    rng = np.random.default_rng(0)
    t = dt * np.arange(120)
    errors, stated = [], []
    for _ in range(400):
        begin = brakes + rng.uniform(0.0, dt)
        read = t + rng.uniform(-0.5 * dt, 0.5 * dt, len(t))
        momentum = -_braked(read - begin, deceleration, duration)[0]
        torque = -_braked(t - begin, deceleration, duration)[1]
        observer, timing = empty_observer(1), zeros(TimingError, joints=1)
        error, variance = [], []
        for i in range(len(t)):
            step = start_step(observer, dt if i else 0.0, BANDWIDTH)
            advance(observer, 0, momentum[i], torque[i], step)
            advance_timing_error(timing, observer.momentum, dt if i else 0.0, BANDWIDTH)
            error.append(observer.residual[0])
            variance.append(timing.variance[0])
        errors.append(error)
        stated.append(variance)
    there = slice(round(brakes / dt), round((brakes + duration) / dt) + 2)
    measured = np.sqrt(np.mean(np.square(errors), axis=0))[there].max()
    expected = np.sqrt(np.mean(stated, axis=0))[there].max()
    assert measured == pytest.approx(expected, rel=1.0 / 3.0)


def _braked(since: np.ndarray, deceleration: float, duration: float) -> tuple[np.ndarray, np.ndarray]:
    """Momentum lost and its rate, a half sine of that height [Nm] and duration [s]; `since` its begin."""
    phase = np.pi * np.clip(since / duration, 0.0, 1.0)
    return deceleration * duration / np.pi * (1.0 - np.cos(phase)), deceleration * np.sin(phase)


def test_it_vanishes_with_the_sample_interval() -> None:
    def largest(dt: float) -> float:
        t = np.arange(0.0, 2.0, dt)
        return float(np.sqrt(_variance(10.0 * np.sin(2.0 * np.pi * t), dt).max()))

    assert largest(0.001) < 0.1 * largest(0.01)


def test_it_is_kept_without_a_sample_and_forgotten_after_a_gap() -> None:
    state = zeros(TimingError, joints=1)
    for i, h in enumerate((5.0, 5.0, 0.0)):
        advance_timing_error(state, np.array([h]), 0.01 if i else 0.0, BANDWIDTH)
    before = state.variance[0]
    assert before == pytest.approx((2.0 * np.pi * BANDWIDTH * 5.0) ** 2 / 12.0)
    state.variance[0] = 0.0
    advance_timing_error(state, np.array([0.0]), NO_STEP, BANDWIDTH)
    assert state.variance[0] == before
    advance_timing_error(state, np.array([0.0]), 0.0, BANDWIDTH)
    assert state.variance[0] == 0.0


def test_of_what_was_before_a_long_interval_the_observer_knows_nothing() -> None:
    """Over several of its time constants the whole error of the rate is left, and no more than that."""
    dt, change = 0.1, 40.0
    momentum = np.array([0.0, 0.0, change * dt])
    assert 2.0 * np.pi * BANDWIDTH * dt > 5.0
    assert _variance(momentum, dt)[-1] == pytest.approx(change**2 / 12.0)
