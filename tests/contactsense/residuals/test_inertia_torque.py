"""The inertia torque that a stream follows, and the part of the model error in proportion to it."""

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Sample, Scene
from contactsense.residuals.inertia_torque import InertiaTorque, follow_inertia_torque
from contactsense.residuals.momentum_observer import advance, empty_observer, start_step
from contactsense.residuals.timing_error import TimingError, advance_timing_error
from contactsense.robots.jit.flat_buffers import zeros
from tests.plain_arm import plain_ur5e

BANDWIDTH, DT = 10.0, 0.01
NO_STEP = -1.0
START = np.array([0.3, -1.2, 1.4, -1.0, 0.5, 0.2])
ACCELERATED = np.array([1.0, -0.6, 0.8, 0.0, 1.2, -1.0])
"""[rad/s^2]"""


def _followed(momentum: np.ndarray, dt: np.ndarray) -> np.ndarray:
    timing, inertia = zeros(TimingError, joints=1), zeros(InertiaTorque, joints=1)
    values = []
    for h, step in zip(momentum, dt, strict=True):
        advance_timing_error(timing, np.array([h]), step, BANDWIDTH)
        follow_inertia_torque(inertia, timing.rate, step, BANDWIDTH)
        values.append(inertia.present[0])
    return np.array(values)


def test_it_is_what_the_observer_makes_of_the_momentum() -> None:
    """At steps of any length, a steady rate through the observer, which knows of no torque."""
    dt = np.concatenate(([0.0], np.random.default_rng(0).uniform(0.2, 3.0, 60) * DT))
    momentum = -7.0 + 30.0 * np.cumsum(dt)
    observer, expected = empty_observer(1), []
    for h, step in zip(momentum, dt, strict=True):
        advance(observer, 0, h, 0.0, start_step(observer, step, BANDWIDTH))
        expected.append(observer.residual[0])
    np.testing.assert_allclose(_followed(momentum, dt), expected, atol=1e-9)


def test_it_is_kept_without_a_sample_and_forgotten_after_a_gap() -> None:
    timing, inertia = zeros(TimingError, joints=1), zeros(InertiaTorque, joints=1)
    for i, h in enumerate((0.0, 1.0, 2.0)):
        advance_timing_error(timing, np.array([h]), DT if i else 0.0, BANDWIDTH)
        follow_inertia_torque(inertia, timing.rate, DT if i else 0.0, BANDWIDTH)
    before = inertia.present[0]
    assert 50.0 < before < 100.0
    inertia.present[0] = 0.0
    follow_inertia_torque(inertia, timing.rate, NO_STEP, BANDWIDTH)
    assert inertia.present[0] == before
    advance_timing_error(timing, np.array([5.0]), 0.0, BANDWIDTH)
    follow_inertia_torque(inertia, timing.rate, 0.0, BANDWIDTH)
    assert inertia.present[0] == 0.0


def _variances(error: float | tuple[float, ...], acceleration: np.ndarray) -> tuple[np.ndarray, Localizer]:
    """Variance of each joint's residual after each sample of 0.6 s from rest, shape (N, 6)."""
    sensor = JointTorqueSensor(model_error=0.4, inertia_torque_error=error)
    localizer = Localizer(Scene(robot=plain_ur5e(), base_wrench=None, joint_torque=sensor))
    found = []
    for t in DT * np.arange(60):
        localizer.step(Sample(float(t), START + 0.5 * acceleration * t * t, acceleration * t, np.zeros(6)))
        found.append(localizer._buffers.state.torque_variance.copy())
    return np.array(found), localizer


def test_the_variance_grows_with_the_square_of_the_inertia_torque() -> None:
    without, _ = _variances(0.0, ACCELERATED)
    for error in (0.05, (0.3, 0.2, 0.1, 0.0, 0.1, 0.2)):
        found, localizer = _variances(error, ACCELERATED)
        torque = localizer._buffers.state.inertia_torque.present
        np.testing.assert_allclose(
            found[-1] - without[-1], (np.array(error) * torque) ** 2, rtol=1e-9, atol=1e-15
        )
        assert np.all(found >= without)
        # The upper arm is heavier than the last wrist.
        assert abs(torque[1]) > 100.0 * abs(torque[5])


def test_nothing_changes_without_acceleration_or_without_the_error() -> None:
    rest = np.zeros(6)
    np.testing.assert_array_equal(_variances(0.3, rest)[0], _variances(0.0, rest)[0])
    localizer = Localizer(
        Scene(robot=plain_ur5e(), base_wrench=None, joint_torque=JointTorqueSensor(inertia_torque_error=0.3))
    )
    plain = Localizer(Scene(robot=plain_ur5e(), base_wrench=None, joint_torque=JointTorqueSensor()))
    for t in DT * np.arange(20):
        sample = Sample(float(t), START + ACCELERATED * t * t / 2.0, ACCELERATED * t, np.zeros(6))
        localizer.step(sample)
        plain.step(sample)
    # A single measurement is one of an arm at rest, also between the samples of a stream.
    torque = np.array([20.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    one, other = (arm.locate(START, joint_torque=torque) for arm in (localizer, plain))
    assert one.status == other.status
    np.testing.assert_array_equal(
        localizer._buffers.state.torque_variance, plain._buffers.state.torque_variance
    )


def test_a_signal_without_inertia_has_no_such_error() -> None:
    def variance(error: float) -> np.ndarray:
        sensor = JointTorqueSensor(meaning="external", inertia_torque_error=error)
        localizer = Localizer(Scene(robot=plain_ur5e(), base_wrench=None, joint_torque=sensor))
        for t in DT * np.arange(40):
            localizer.step(Sample(float(t), START + ACCELERATED * t * t / 2.0, ACCELERATED * t, np.zeros(6)))
        return localizer._buffers.state.torque_variance.copy()

    np.testing.assert_array_equal(variance(0.3), variance(0.0))


@pytest.mark.parametrize("wrong", [-0.1, (0.1, 0.2)])
def test_wrong_values_are_refused(wrong: float | tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="inertia_torque_error"):
        Scene.model_validate({"robot": plain_ur5e(), "joint_torque": {"inertia_torque_error": wrong}})
