"""The momentum observer on simulated motion: it is the analytic low-pass of the external part, and nothing
else."""

import itertools
from typing import NamedTuple

import numpy as np
import pytest

from contactsense import JointTorqueSensor, robots
from contactsense.kinematics.inverse_dynamics import inverse_dynamics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.residuals.equations_of_motion import (
    advance_base,
    advance_torques,
    observe_wrench,
    wrenches_to_base_frame,
)
from contactsense.residuals.joint_friction import joint_torque_model
from contactsense.residuals.momentum_observer import (
    MomentumObserver,
    advance,
    advance_all,
    copy_history,
    empty_observer,
    in_step,
    noise_variance_ratio,
    start_step,
)
from contactsense.residuals.observers import Observers, start_steps
from contactsense.robots.jit.flat_buffers import zeros

MODEL = build_model(robots.load("ur5e"))
DRIVE = joint_torque_model(JointTorqueSensor(), 6)
GRAVITY = np.array([1.0, -3.0, -9.0])
BANDWIDTH = 8.0
SPEED = np.linspace(1.0, 3.0, 6)
LINK = 4
"""The touched link: joints 1..4 see the contact."""


def _swing(t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A smooth motion of up to 3 rad/s in all joints: position, velocity, acceleration at time t."""
    return np.sin(SPEED * t), SPEED * np.cos(SPEED * t), -(SPEED**2) * np.sin(SPEED * t)


def _push(t: float) -> np.ndarray:
    """A contact wrench that comes and goes, base axes, base origin."""
    return np.array([5.0, -12.0, 8.0, 1.0, 2.0, -3.0]) * np.sin(2.0 * np.pi * t) ** 2


class _Residuals(NamedTuple):
    joints: np.ndarray
    bodies: np.ndarray
    """Frame of each body, shape (42,)."""
    match: np.ndarray


def _follow(times: np.ndarray, noise: np.ndarray | None = None, push: bool = True) -> _Residuals:
    """What the observers say after all samples; `noise`: of base wrench, then torques, shape (N, 12)."""
    observers = zeros(Observers, joints=6, link_sensors=0)
    torque, reading, motion, spread = np.empty(6), np.empty(6), empty_motion(6), np.zeros((2, 6))
    last = times[0]
    for i, t in enumerate(times):
        q, qd, qdd = _swing(t)
        inverse_dynamics(MODEL, q, qd, qdd, GRAVITY, motion, torque, reading)
        if push:
            torque[:LINK] -= motion.screw[:LINK] @ _push(t)
            reading += _push(t)
        if noise is not None:
            reading += noise[i, :6]
            torque += noise[i, 6:]
        dt, last = t - last, t
        of_base, *of_torques = start_steps(observers, np.full(3, dt), BANDWIDTH)
        advance_base(motion, reading, of_base, observers.base)
        readings, steps = (qd, torque, reading), (of_torques[0], of_torques[1])
        advance_torques(MODEL, DRIVE, motion, readings, (dt, dt), steps, observers, spread[0], spread[1])
    joints, bodies, match = observers.joints, observers.base, observers.torque_difference
    return _Residuals(joints.residual, bodies.residual, match.residual)


def _analytic(start: float, stop: float) -> _Residuals:
    """The first-order filter of the true external part, by Gauss-Legendre quadrature."""
    K = 2.0 * np.pi * BANDWIDTH
    nodes, weights = np.polynomial.legendre.leggauss(12)
    edges = np.linspace(start, stop, 61)
    joints, bodies, match, motion = np.zeros(6), np.zeros((7, 6)), np.zeros(6), empty_motion(6)
    for a, b in itertools.pairwise(edges):
        for t, weight in zip((a + b) / 2 + (b - a) / 2 * nodes, (b - a) / 2 * weights, strict=True):
            q, qd, _ = _swing(t)
            kinematics_and_momenta(MODEL, q, qd, GRAVITY, motion)
            share = K * np.exp(-K * (stop - t)) * weight
            w = _push(t)
            joints[:LINK] += share * motion.screw[:LINK] @ w
            match[LINK:] -= share * motion.screw[LINK:] @ w
            for body in range(7):
                R, o = motion.rotation[body], motion.origin[body]
                bodies[body, :3] += share * R.T @ w[:3]
                bodies[body, 3:] += share * R.T @ (w[3:] - np.cross(o, w[:3]))
    return _Residuals(joints, bodies.ravel(), match)


def _error(found: _Residuals, expected: _Residuals) -> float:
    return max(float(np.abs(a - b).max()) for a, b in zip(found, expected, strict=True))


def test_the_residual_is_the_analytic_filter_of_the_external_part() -> None:
    times = np.arange(0.0, 0.6, 0.002)
    assert _error(_follow(times), _analytic(0.0, times[-1])) < 1e-6


def test_at_a_quarter_of_the_rate_it_is_still_close_and_of_fourth_order() -> None:
    """125 Hz: the error grows with the fourth power of the sample time, 256-fold."""
    slow = np.arange(0.0, 0.6, 0.008)
    error = _error(_follow(slow), _analytic(0.0, slow[-1]))
    assert error < 256 * 1e-6
    twice = np.arange(0.0, 0.6, 0.016)
    assert _error(_follow(twice), _analytic(0.0, twice[-1])) > 8.0 * error


@pytest.mark.parametrize("rate", [500.0, 125.0])
def test_jitter_and_lost_samples_change_nothing_but_the_noise(rate: float) -> None:
    """Stamps that jitter by half a millisecond, one sample in a hundred lost: within the noise of a steady
    stream, of which it is a hundredth."""
    chance = np.random.default_rng(1)
    steady = np.arange(0.0, 0.6, 1.0 / rate)
    times = steady + 0.0005 * chance.uniform(-1.0, 1.0, len(steady))
    times = times[chance.random(len(times)) >= 0.01]
    noise = (
        np.sqrt(noise_variance_ratio(BANDWIDTH, 1.0 / rate)) * 0.05
    )  # of 0.05 N and Nm a sample, the quietest sensor
    assert _error(_follow(times), _analytic(times[0], times[-1])) < 0.05 * noise


def test_residuals_vanish_in_free_motion() -> None:
    assert np.abs(np.concatenate(_follow(np.arange(0.0, 1.0, 0.002), push=False))).max() < 1e-6


def test_wrenches_come_back_from_the_bodies_frames() -> None:
    motion, out = empty_motion(6), np.empty((7, 6))
    q, qd, _ = _swing(0.3)
    kinematics_and_momenta(MODEL, q, qd, GRAVITY, motion)
    w = np.array([1.0, -2.0, 3.0, 0.4, 0.5, -0.6])
    inside = [
        np.concatenate((R.T @ w[:3], R.T @ (w[3:] - np.cross(o, w[:3]))))
        for R, o in zip(motion.rotation, motion.origin, strict=True)
    ]
    wrenches_to_base_frame(motion, np.concatenate(inside), out)
    np.testing.assert_allclose(out, np.tile(w, (7, 1)), atol=1e-14)


def _filter(inputs: np.ndarray, steps: np.ndarray) -> tuple[np.ndarray, MomentumObserver]:
    """Residuals of a sensor that carries nothing, sample by sample."""
    state, out = empty_observer(6), []
    for value, dt in zip(inputs, steps, strict=True):
        observe_wrench(np.zeros(6), np.zeros(6), value, dt, BANDWIDTH, state)
        out.append(state.residual.copy())
    return np.array(out), state


@pytest.mark.parametrize("bandwidth_of_dt", [1e-9, 1e-3, 0.02, 0.3, 1.0, 10.0])
def test_a_constant_has_a_first_order_response(bandwidth_of_dt: float) -> None:
    """Whatever the step, from far below the time constant to far above it."""
    dt = bandwidth_of_dt / BANDWIDTH
    wrench = np.arange(1.0, 7.0)
    found, _ = _filter(np.tile(wrench, (20, 1)), np.array([0.0] + [dt] * 19))
    lag = -np.expm1(-2 * np.pi * BANDWIDTH * dt * np.arange(20))
    np.testing.assert_allclose(found, lag[:, None] * wrench, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("rate", [0.5, 1.0, 1.25, 1.5, 1.75, 2.0, 3.0, 5.0, 50.0])
def test_a_step_between_two_samples_overshoots_at_low_rates_only(rate: float) -> None:
    """The cubic through the samples is no step. `rate`: in multiples of the bandwidth."""
    step = np.zeros((400, 6))
    step[5:] = 1.0
    found, _ = _filter(step, np.array([0.0] + [1.0 / (rate * BANDWIDTH)] * 399))
    assert found.max() - 1.0 < (0.14 if rate < 4.0 else 1e-9)
    np.testing.assert_allclose(found[-1], 1.0, rtol=1e-6)


def test_a_restart_resets_the_residual() -> None:
    wrench = np.arange(1.0, 7.0)
    fresh, _ = _filter(np.tile(wrench, (10, 1)), np.array([0.0] + [0.002] * 9))
    inputs = np.vstack((np.full((10, 6), 50.0), np.tile(wrench, (10, 1))))
    again, _ = _filter(inputs, np.array(2 * [0.0, *[0.002] * 9]))
    np.testing.assert_array_equal(again[10:], fresh)


@pytest.mark.parametrize("ragged", [False, True])
def test_the_variance_ratio_is_that_of_filtered_noise(ragged: bool) -> None:
    chance, n = np.random.default_rng(3), 40_000
    steps = np.full(n, 0.002)
    if ragged:
        steps += chance.uniform(-0.001, 0.001, n)
        steps[chance.random(n) < 0.05] *= 4.0
    steps[0] = 0.0
    state, ratio = empty_observer(6), []
    for i in range(n):
        observe_wrench(np.zeros(6), np.zeros(6), chance.standard_normal(6), steps[i], BANDWIDTH, state)
        if i > 1000:
            ratio.append(np.mean(state.residual**2) / state.history[0].variance_ratio)
    # 234,000 values with a correlation time of ten samples: the variance is known to about 1 %.
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.05)
    if not ragged:
        assert state.history[0].variance_ratio == pytest.approx(
            noise_variance_ratio(BANDWIDTH, 0.002), rel=1e-6
        )


def test_at_a_late_sample_the_integrand_is_a_straight_line() -> None:
    """A cubic through samples 2 ms apart would be extrapolated over 20 ms, and their noise with it."""
    observer = empty_observer(0)
    for i in range(8):
        start_step(observer, 0.002 if i else 0.0, BANDWIDTH)
    K, dt = 2.0 * np.pi * BANDWIDTH, 0.02
    a, *weights, _ = start_step(observer, dt, BANDWIDTH)
    assert weights[2] == weights[3] == 0.0
    # K times the integrals of exp(-K (t1 - t)) times g, for g = 1 and for g = t.
    s = np.linspace(0.0, dt, 20_001)
    kernel = K * np.exp(-K * (dt - s))
    assert a == pytest.approx(np.exp(-K * dt))
    assert weights[0] + weights[1] == pytest.approx(np.trapezoid(kernel, s), rel=1e-6)
    assert weights[0] * dt == pytest.approx(np.trapezoid(kernel * s, s), rel=1e-6)


@pytest.mark.parametrize("short", [1e-5, 1e-4, 5e-4])
def test_a_sample_that_comes_too_soon_amplifies_no_noise(short: float) -> None:
    """Nor does it in the steps after it, whose cubic would pass through two samples at nearly one time."""
    observer, ratios = empty_observer(0), []
    for dt in (0.0, *[0.002] * 400, short, *[0.002] * 10):
        start_step(observer, dt, BANDWIDTH)
        ratios.append(observer.history[0].variance_ratio)
    assert max(ratios[-11:]) < 1.05 * ratios[-12]


def test_groups_are_in_step_after_the_same_steps_only() -> None:
    def after(*steps: float) -> MomentumObserver:
        observer = empty_observer(0)
        for dt in steps:
            start_step(observer, dt, BANDWIDTH)
        return observer

    steps = (0.0, 0.002, 0.004, 0.002, 0.002)
    assert in_step(after(*steps), after(*steps))
    for others in ((*steps, 0.002), (*steps[:-1], 0.003), (0.0, 0.004, 0.002, 0.002, 0.002), (*steps, 0.0)):
        assert not in_step(after(*steps), after(*others))
    for name in (
        "samples",
        "step",
        "step_before",
        "variance_ratio",
        "covariance_0",
        "covariance_1",
        "covariance_2",
    ):
        one, other = after(*steps), after(*steps)
        other.history[0][name] += 1
        assert not in_step(one, other)
        copy_history(other, one)
        assert in_step(one, other)


def test_all_equations_at_once_are_those_one_by_one() -> None:
    """Through a start, steps of any length and a restart."""
    rng = np.random.default_rng(3)
    one, all_ = empty_observer(19), empty_observer(19)
    for dt in (0.0, 0.01, 0.02, 0.008, 0.05, 0.01, 0.0, 0.01, 0.01):
        h, drift = rng.normal(size=(2, 19))
        step = start_step(one, dt, 5.0)
        for i in range(19):
            advance(one, i, h[i], drift[i], step)
        advance_all(all_, h, drift, start_step(all_, dt, 5.0))
        np.testing.assert_allclose(all_.residual, one.residual, rtol=1e-12, atol=1e-13)
    np.testing.assert_array_equal(all_.momentum, one.momentum)
    np.testing.assert_allclose(all_.integrand, one.integrand, rtol=1e-14)
