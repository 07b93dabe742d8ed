"""Sudden changes of the accelerations over the steps of one force/torque sensor."""

import numpy as np
import pytest

from contactsense.residuals.sensor_step_change import SensorStepChange, follow_sensor_step
from contactsense.residuals.velocity_noise import VelocityNoise, follow_velocity_noise
from contactsense.robots.jit.flat_buffers import zeros

DT = 0.002


def changes(velocity: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Those of the sensor and those of the samples, for velocities (N, n) and the samples with a value (M,),
    of which a gap of more than 20 samples restarts the sensor; shapes (M, n)."""
    n = velocity.shape[1]
    velocities, state = zeros(VelocityNoise, joints=n), zeros(SensorStepChange, joints=n)
    found, of_samples, last = [], [], -1000
    for i, qd in enumerate(velocity):
        follow_velocity_noise(velocities, qd, DT if i else 0.0)
        if i in values:
            step = i - last
            changed = follow_sensor_step(state, velocities, velocities.history[0].step * step * (step <= 20))
            found.append(state.change.copy())
            of_samples.append(velocities.change.copy())
            assert changed == bool(found[-1].any())
            last = i
    return np.array(found), np.array(of_samples)


def noisy(samples: int, joints: int, seed: int) -> np.ndarray:
    """Velocities of a steady motion."""
    return np.asarray(0.3 + 0.001 * np.random.default_rng(seed).standard_normal((samples, joints)))


def test_a_sensor_with_a_value_in_each_sample_has_those_of_the_samples() -> None:
    found, of_samples = changes(noisy(200, 2, seed=1), np.arange(50, 200))
    assert np.count_nonzero(of_samples) > 50
    np.testing.assert_array_equal(found, of_samples)


@pytest.mark.parametrize("pattern", [(0, 4, 8, 12), (0, 1, 2, 8)])
def test_noise_hardly_counts(pattern: tuple[int, ...]) -> None:
    """As little as in the samples, also where one step is six times as long as the one before it."""
    values = np.array([16 * k + i for k in range(400) for i in pattern])
    found, _ = changes(noisy(6400, 6, seed=2), values)
    steps, later = DT * np.diff(values), slice(100, None)
    rates = 1.0 / steps
    own = 2.0 * (rates[1:] ** 2 + rates[:-1] ** 2 + rates[1:] * rates[:-1]) * 0.001**2
    in_each_sample = steps[1:] < 1.5 * DT
    share = (found[2:] ** 2).mean(axis=1)[~in_each_sample][later] / own[~in_each_sample][later]
    assert 0.1 < share.mean() < 0.3


def test_after_a_gap_two_steps_have_to_be_known() -> None:
    """The velocity has changed meanwhile, and so has its rate."""
    t = DT * np.arange(300)
    velocity = (0.3 + 5.0 * np.maximum(t - 0.2, 0.0))[:, None]
    values = np.concatenate((np.arange(0, 80, 4), np.arange(140, 300, 4)))
    found, _ = changes(velocity, values)
    assert not found.any()
    values = np.arange(0, 300, 4)
    found, _ = changes(velocity, values)
    assert values[int(np.argmax(found[:, 0]))] == 104
    assert found.max() == pytest.approx(5.0, rel=1e-3)


@pytest.mark.parametrize(("present", "variance"), [(1e-6, 1e-6), (0.0, 1e-6), (1e-6, 1e-8)])
def test_a_joint_has_the_noise_of_these_steps(present: float, variance: float) -> None:
    """At rest now, or with more noise in its first samples than on average: D is 2.5 standard deviations."""
    velocities, state = zeros(VelocityNoise, joints=1), zeros(SensorStepChange, joints=1)
    velocities.variance[0], velocities.present[0], velocities.history[0].step = variance, present, DT
    for velocity, step in ((0.0, 0.0), (0.0, 4.0 * DT), (2.5e-3 * 6.0**0.5, 4.0 * DT)):
        velocities.velocity[0] = velocity
        changed = follow_sensor_step(state, velocities, step)
    assert changed
    D = velocity / (4.0 * DT)
    assert state.change[0] ** 2 == pytest.approx((1.0 - 1.0 / 2.5**2) * D**2)
