"""The bias filter against dense linear algebra: r = Phi e + noise, with e of covariance P."""

from typing import NamedTuple

import numpy as np
import pytest

from contactsense import JointTorqueSensor, robots
from contactsense.kinematics.model import Motion, build_model, empty_motion
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.kinematics.wrench_transform import wrench_transform
from contactsense.residuals.bias_filter import (
    BiasFilter,
    friction_above_scene,
    mass_covariance,
    predict,
    restart,
)
from contactsense.residuals.bias_update import update_by_torque, update_by_wrench
from contactsense.residuals.joint_friction import JointTorqueModel, joint_torque_model
from contactsense.residuals.momentum_observer import advance_all, empty_observer, start_step
from contactsense.residuals.payload_error import add_payload_errors, remove_payload_errors
from contactsense.robots import Inertia
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.sensors.settings import Friction

N = 6
SIZE = 9 + 3 * N
MODEL = build_model(robots.load("ur5e"))
GRAVITY = np.array([0.5, -1.0, -9.7])
BANDWIDTH, DT = 10.0, 0.004


class Filter(NamedTuple):
    state: BiasFilter
    drive: JointTorqueModel
    motion: Motion


def torque_model() -> JointTorqueModel:
    return joint_torque_model(JointTorqueSensor(friction=Friction(coulomb=3.0, error=0.2)), N)


AXIS = np.array([0.6, 0.0, 0.8])
"""Along which the place of the payload is not known."""
PLACE = np.array([0.02, -0.03, 0.1])


def in_motion(seed: int = 0, axis: np.ndarray | None = None) -> Filter:
    """A filter after some samples of a swinging arm with a payload, all of whose estimates are correlated."""
    drive, motion, state = torque_model(), empty_motion(N), zeros(BiasFilter, joints=N)
    restart(state, 0.05, np.array([0.0, 0.0, -30.0, 1.0, 2.0, 0.0]), drive.friction_error)
    state.status[0].payload_mass, state.payload_place[:], state.gravity[:] = 1.5, PLACE, GRAVITY
    state.height_axis[:] = 0.0 if axis is None else axis
    chance = np.random.default_rng(seed)
    for i in range(60):
        if i == 59:
            spread = chance.standard_normal((SIZE, SIZE))
            state.covariance[:] = 1e-3 * spread @ spread.T
            state.friction_regressor[:] = chance.uniform(-4.0, 4.0, N)
        q, qd = np.sin(0.02 * i + np.arange(6.0)), np.cos(0.02 * i + np.arange(6.0))
        kinematics_and_momenta(MODEL, q, qd, GRAVITY, motion)
        noise = 0.01 * np.eye(6), np.full(N, 0.02)
        predict(state, drive, motion, *noise, 0.1, DT if i else 0.0, DT, BANDWIDTH)
    return Filter(state, drive, motion)


def phi(state: BiasFilter) -> np.ndarray:
    """Rows of the torques, then of the base wrench, shape (N + 6, SIZE)."""
    rows = np.zeros((N + 6, SIZE))
    rows[:N, 6 : 6 + N] = np.eye(N)
    rows[:N, 6 + N : 6 + 2 * N] = np.diag(state.friction_regressor)
    rows[N:, :6] = -np.eye(6)
    rows[:, 6 + 2 * N :] = np.asarray(state.mass_regressor.residual).reshape(N + 3, N + 6).T
    return rows


def test_what_remains_uncertain_is_added_to_the_residuals() -> None:
    state = in_motion().state
    rows = phi(state)
    assert np.abs(rows[:, 6 + 2 * N : 6 + 3 * N]).max() > 10.0
    assert np.abs(rows[:, 6 + 3 * N :]).max() > 10.0
    covariance = rows @ state.covariance @ rows.T
    np.testing.assert_allclose(state.torque_variance, np.diag(covariance)[:N], rtol=1e-10)
    np.testing.assert_allclose(state.base_covariance, covariance[N:, N:], rtol=1e-10, atol=1e-12)


def of_square() -> np.ndarray:
    """What the square of an error along `AXIS` adds to the residuals of `in_motion`, by what places on both
    sides of the payload's do, shape (N + 6,)."""
    observer, motion = empty_observer(N + 6), empty_motion(N)
    for i in range(60):
        q, qd = np.sin(0.02 * i + np.arange(6.0)), np.cos(0.02 * i + np.arange(6.0))
        kinematics_and_momenta(MODEL, q, qd, GRAVITY, motion)
        momentum = np.zeros(6)
        for side, weight in ((-1.0, 0.5), (0.0, -1.0), (1.0, 0.5)):
            point = motion.origin[N] + motion.rotation[N] @ (PLACE + side * AXIS)
            p = 1.5 * (motion.twist[N, :3] + np.cross(motion.twist[N, 3:], point))
            momentum += weight * np.concatenate((p, np.cross(point, p)))
        drift = np.append(motion.screw_rate @ momentum, np.zeros(6))
        step = start_step(observer, DT if i else 0.0, BANDWIDTH)
        advance_all(observer, np.append(motion.screw @ momentum, momentum), drift, step)
    return np.array(observer.residual)


def variance_of_square(state: BiasFilter) -> float:
    """Of the square of a normal error, about zero."""
    return 3.0 * float(AXIS @ state.covariance[-3:, -3:] @ AXIS) ** 2


def test_a_height_that_is_not_known_has_a_square_in_the_residuals() -> None:
    state, square = in_motion(axis=AXIS).state, of_square()
    np.testing.assert_allclose(state.height_regressor.residual, square, rtol=1e-9, atol=1e-12)
    # The covariance of the last sample, and that of a link sensor.
    rows, variance = phi(state), variance_of_square(state)
    covariance = rows @ state.covariance @ rows.T + variance * np.outer(square, square)
    assert (np.diag(covariance)[N + 3 :] > np.diag(rows @ state.covariance @ rows.T)[N + 3 :]).all()
    np.testing.assert_allclose(state.torque_variance, np.diag(covariance)[:N], rtol=1e-10)
    np.testing.assert_allclose(state.base_covariance, covariance[N:, N:], rtol=1e-10, atol=1e-12)
    carried, P, found = rows[N:, 18:], state.covariance[18:, 18:], np.full((6, 6), np.nan)
    mass_covariance(state, 1, found)
    of_payload = variance * np.outer(square[N:], square[N:])
    np.testing.assert_allclose(found, carried @ P @ carried.T + of_payload, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("first_body", [1, 4])
def test_masses_of_what_a_link_sensor_carries_are_uncertain(first_body: int) -> None:
    state = in_motion().state
    masses = slice(6 + 2 * N + first_body - 1, None)
    carried, P = phi(state)[N:, masses], state.covariance[masses, masses]
    found = np.full((6, 6), np.nan)
    mass_covariance(state, first_body, found)
    np.testing.assert_allclose(found, carried @ P @ carried.T, rtol=1e-10, atol=1e-12)


def test_an_update_by_a_torque_is_that_of_a_kalman_filter() -> None:
    state = in_motion().state
    row, P = phi(state)[2], state.covariance.copy()
    before = np.random.default_rng(3).standard_normal(SIZE)
    state.correction[:] = before
    residual, variance = 2.5, 0.3
    gain = P @ row / (row @ P @ row + variance)
    update_by_torque(state, 2, residual, variance)
    # What has been corrected already is still in the residual, whose correction follows.
    np.testing.assert_allclose(state.correction, before - gain * (residual + row @ before), rtol=1e-9)
    np.testing.assert_allclose(state.covariance, P - np.outer(gain, row @ P), rtol=1e-8, atol=1e-12)


def test_an_update_by_a_wrench_counts_that_its_noise_is_correlated() -> None:
    """That of a sensor below the base: its moments about the base origin have the noise of its forces."""
    state, chance = in_motion().state, np.random.default_rng(3)
    rows, P = phi(state)[N:], state.covariance.copy()
    transfer = wrench_transform(np.eye(3), np.array([0.3, 0.1, -0.6]))
    noise = transfer @ np.diag([0.2, 0.2, 0.2, 0.01, 0.01, 0.01]) @ transfer.T
    before, wrench = chance.standard_normal(SIZE), chance.standard_normal(6)
    state.correction[:] = before
    gain = np.linalg.solve(rows @ P @ rows.T + 1.5 * noise, rows @ P).T
    update_by_wrench(state, wrench, noise, 1.5)
    np.testing.assert_allclose(state.correction, before - gain @ (wrench + rows @ before), rtol=1e-7)
    np.testing.assert_allclose(state.covariance, P - gain @ rows @ P, rtol=1e-7, atol=1e-11)


def test_the_bare_link_is_known_no_better_while_it_carries_a_payload() -> None:
    """A Kalman filter that does not correct it: what remains is the covariance of all errors together."""
    state, chance = in_motion().state, np.random.default_rng(4)
    spread = 0.03 * chance.standard_normal((SIZE + 1, SIZE + 1))
    P = spread @ spread.T
    state.covariance[:], state.bare_covariance[:] = P[:SIZE, :SIZE], P[SIZE, :SIZE]
    row, variance = np.append(phi(state)[2], 0.0), 0.3
    gain = P @ row / (row @ P @ row + variance)
    gain[SIZE] = 0.0
    kept = np.eye(SIZE + 1) - np.outer(gain, row)
    expected = kept @ P @ kept.T + variance * np.outer(gain, gain)
    update_by_torque(state, 2, 2.5, variance)
    np.testing.assert_allclose(state.bare_covariance, expected[SIZE, :SIZE], rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(state.covariance, expected[:SIZE, :SIZE], rtol=1e-7, atol=1e-11)


@pytest.mark.parametrize("error", [0.0, 0.05])
def test_a_payload_that_is_put_down_at_once_leaves_all_as_it_was(error: float) -> None:
    """What is not known of the last link is still the same sums with other errors."""
    state, chance = in_motion().state, np.random.default_rng(5)
    last = 5 + 6 + 2 * N
    spread = error * chance.standard_normal((last + 1, last + 1))
    state.status[0].payload_mass, state.covariance[:] = 0.0, 0.0
    state.covariance[: last + 1, : last + 1] = spread @ spread.T
    before = state.covariance.copy()
    link, payload = robots.load("ur5e").links[-1].inertia, Inertia(1.5, np.full(3, 0.1), np.zeros((3, 3)))
    add_payload_errors(state, link, payload, np.eye(3), np.full(3, 0.3), GRAVITY, 1e-4 * np.eye(6))
    assert np.trace(state.covariance) > np.trace(before)
    remove_payload_errors(state, before[last, last], error > 0.0)
    np.testing.assert_allclose(state.covariance, before, rtol=1e-12)


def test_updates_count_the_square_of_an_error_of_the_height_as_noise() -> None:
    state, square = in_motion(axis=AXIS).state, of_square()
    state.covariance[:] *= 30.0
    rows, P, noise = phi(state), state.covariance.copy(), np.diag([0.2, 0.2, 0.2, 0.01, 0.01, 0.01])
    variance = variance_of_square(state)
    R = 1.5 * noise + variance * np.outer(square[N:], square[N:])
    gain = np.linalg.solve(rows[N:] @ P @ rows[N:].T + R, rows[N:] @ P).T
    update_by_wrench(state, np.ones(6), noise, 1.5)
    np.testing.assert_allclose(state.correction, -gain @ np.ones(6), rtol=1e-7)
    state.correction[:], state.covariance[:] = 0.0, P
    gain = P @ rows[1] / (rows[1] @ P @ rows[1] + 0.3 + variance * square[1] ** 2)
    update_by_torque(state, 1, 2.0, 0.3)
    np.testing.assert_allclose(state.correction, -2.0 * gain, rtol=1e-9)


def test_friction_above_that_of_the_scene() -> None:
    """The regressor is friction with the estimated factor; with the scene's, it would be that over it."""
    state, drive, _ = in_motion()
    drive.friction_factor[2] = 1.6
    state.friction_regressor[2] = 8.0
    assert friction_above_scene(state, drive, 2) == pytest.approx(8.0 - 8.0 / 1.6)


def test_biases_wander_as_far_in_a_gap_as_in_samples() -> None:
    """The variance of a random walk grows with time, not with its square."""
    gap, steps = in_motion(), in_motion()
    before = np.diag(gap.state.covariance)[: 6 + N].copy()
    noise = 0.01 * np.eye(6), np.full(N, 0.02)
    predict(*gap, *noise, 0.1, 500 * DT, DT, BANDWIDTH)
    for _ in range(500):
        predict(*steps, *noise, 0.1, DT, DT, BANDWIDTH)
    grown = [np.diag(found.state.covariance)[: 6 + N] - before for found in (gap, steps)]
    np.testing.assert_allclose(grown[0], grown[1], rtol=1e-9)
    np.testing.assert_allclose(grown[0], np.repeat([0.01, 0.02], 6) * DT * 500 * DT / 10.0**2, rtol=1e-9)
