"""The momentum observer on simulated motion: it sees external forces, and nothing else."""

import numpy as np
import pytest

from contactsense.drive import make_drive
from contactsense.observer import empty_observer, noise_gain, observe_joints, observe_wrench
from contactsense.sensing import JointTorqueSensor
from kinematics.core import inverse_dynamics, move
from kinematics.model import build_model, empty_motion
from tests.oracles.random_arm import random_arm

ARM = random_arm(11, 6)
MODEL = build_model(ARM)
DRIVE = make_drive(JointTorqueSensor(), 6)
GRAVITY = np.array([1.0, -3.0, -9.0])
BANDWIDTH = 8.0


def _swing(t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A smooth motion: position, velocity, acceleration at time t."""
    speed = np.linspace(1.0, 3.0, 6)
    return np.sin(speed * t), speed * np.cos(speed * t), -(speed**2) * np.sin(speed * t)


def _follow(times: np.ndarray, wrench: np.ndarray, link: int) -> tuple[np.ndarray, np.ndarray]:
    """Residuals after all samples, with a constant contact wrench on a link from the start."""
    joints, base = empty_observer(6), empty_observer(6)
    torque, reading, spread, motion = np.empty(6), np.empty(6), np.empty(6), empty_motion(6)
    last = None
    for t in times:
        q, qd, qdd = _swing(t)
        inverse_dynamics(MODEL, q, qd, qdd, GRAVITY, motion, torque, reading)
        torque[:link] -= motion.screw[:link] @ wrench
        reading += wrench
        dt = 0.0 if last is None else t - last
        last = t
        observe_joints(MODEL, DRIVE, motion, qd, torque, dt, BANDWIDTH, joints, spread)
        observe_wrench(motion.momentum[0], motion.gravity[0], reading, dt, BANDWIDTH, base)
    return joints.residual, base.residual


@pytest.mark.parametrize("jitter", [0.0, 0.0005])
@pytest.mark.parametrize("lost", [0.0, 0.05])
def test_residuals_settle_at_the_external_part(jitter: float, lost: float) -> None:
    chance = np.random.default_rng(1)
    times = np.arange(0.0, 0.6, 0.002) + jitter * chance.uniform(-1, 1, 300)
    times = times[chance.random(300) >= lost]
    wrench = np.array([5.0, -12.0, 8.0, 1.0, 2.0, -3.0])
    joints, base = _follow(times, wrench, 4)
    motion = empty_motion(6)
    q, qd, _ = _swing(times[-1])
    move(MODEL, q, qd, GRAVITY, motion)
    expected = np.where(np.arange(6) < 4, motion.screw @ wrench, 0.0)
    # The base wrench is constant; s_j . w moves with the arm, and the residual lags by a time constant of 20
    # ms.
    np.testing.assert_allclose(base, wrench, atol=2e-2)
    np.testing.assert_allclose(joints, expected, atol=0.02 * 3.0 * np.abs(expected).max() + 2e-2)


def test_free_motion_leaves_nothing() -> None:
    joints, base = _follow(np.arange(0.0, 1.0, 0.002), np.zeros(6), 0)
    # What remains is the trapezoidal rule's error, of second order in the sample time.
    assert np.abs(np.concatenate((joints, base))).max() < 2e-2
    finer = _follow(np.arange(0.0, 1.0, 0.001), np.zeros(6), 0)
    assert np.abs(np.concatenate(finer)).max() < 0.3 * np.abs(np.concatenate((joints, base))).max()


def test_a_step_is_answered_by_a_first_order_lag() -> None:
    state, dt = empty_observer(6), 0.004
    wrench = np.arange(1.0, 7.0)
    for i in range(20):
        observe_wrench(np.zeros(6), np.zeros(6), wrench, dt if i else 0.0, BANDWIDTH, state)
    expected = -np.expm1(-2 * np.pi * BANDWIDTH * dt * 19) * wrench
    np.testing.assert_allclose(state.residual, expected, rtol=1e-12)


def test_noise_gain_is_the_variance_that_comes_out() -> None:
    chance, state, dt = np.random.default_rng(3), empty_observer(6), 0.002
    kept = []
    for i in range(40_000):
        noise = chance.standard_normal(6)
        observe_wrench(np.zeros(6), np.zeros(6), noise, dt if i else 0.0, BANDWIDTH, state)
        if i > 1000:
            kept.append(state.residual.copy())
    # 234,000 values with a correlation time of ten samples: the variance is known to about 1 %.
    assert np.var(kept) == pytest.approx(noise_gain(BANDWIDTH, dt), rel=0.05)
