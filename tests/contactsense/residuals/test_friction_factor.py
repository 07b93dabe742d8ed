"""Friction that differs from the scene's by a factor is estimated in free motion, and told from a contact."""

from collections.abc import Iterator

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Sample, Scene
from contactsense.kinematics.inverse_dynamics import inverse_dynamics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.sensors.settings import Friction
from tests.plain_arm import plain_ur5e

ARM = plain_ur5e()
COULOMB = np.array([8.0, 7.0, 4.0, 1.5, 1.2, 1.0])
VISCOUS = np.array([10.0, 9.0, 5.0, 2.0, 1.5, 1.0])
WIDTH = 0.05
RATE = np.array([2.0, 1.5, 2.5, 3.0, 2.0, 1.0])
NOISE = 0.3
ERROR = 0.1
BIAS = np.array([0.5, -0.4, 0.3, -0.2, 0.1, 0.05])
LINK = 3


def _scene(error: float = ERROR, **changes: object) -> Scene:
    friction = Friction(coulomb=tuple(COULOMB), viscous=tuple(VISCOUS), velocity=WIDTH, error=error)
    torque = JointTorqueSensor(noise=NOISE, friction=friction)
    return Scene(robot=ARM, base_wrench=None, joint_torque=torque, **changes)


def _swing(
    factor: np.ndarray,
    seconds: float,
    *,
    dt: float = 0.004,
    noise: float = NOISE,
    bias: np.ndarray | float = 0.0,
    push: tuple[float, float] = (np.inf, 0.0),
    seed: int = 0,
) -> Iterator[Sample]:
    """The arm swings with friction that is `factor` times the scene's; from `push[0]` [s] on a force of
    `push[1]` [N] acts on the forearm."""
    model, motion, chance = build_model(ARM), empty_motion(6), np.random.default_rng(seed)
    gravity, torque, wrench = Scene(robot=ARM).gravity_base, np.empty(6), np.empty(6)
    for t in np.arange(0.0, seconds, dt):
        q = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5]) + 0.6 / RATE * np.sin(RATE * t)
        qd, qdd = 0.6 * np.cos(RATE * t), -0.6 * RATE * np.sin(RATE * t)
        inverse_dynamics(model, q, qd, qdd, gravity, motion, torque, wrench)
        read = torque + factor * (COULOMB * np.tanh(qd / WIDTH) + VISCOUS * qd) + bias
        if t >= push[0]:
            kinematics_and_momenta(model, q, qd, np.zeros(3), motion)
            R, o = motion.rotation[LINK], motion.origin[LINK]
            point, force = R @ np.array([-0.2, 0.04, 0.007]) + o, R @ np.array([0.0, -push[1], 0.0])
            w = np.concatenate((force, np.cross(point, force)))
            read -= np.where(np.arange(6) < LINK, motion.screw @ w, 0.0)
        yield Sample(float(t), q, qd, read + noise * chance.standard_normal(6))


def _factors(localizer: Localizer) -> tuple[np.ndarray, np.ndarray]:
    """Estimated factors on friction and their standard deviations."""
    covariance = localizer._buffers.state.bias_filter.covariance
    factor = localizer.friction_factors
    return factor, factor * np.sqrt(np.diag(covariance)[12:18])


@pytest.mark.parametrize("factor", [0.85, 1.0, 1.2])
def test_the_factor_is_found_and_the_residual_vanishes(factor: float) -> None:
    localizer = Localizer(_scene())
    residual = []
    for sample in _swing(np.full(6, factor), 8.0, noise=0.0):
        localizer.step(sample)
        residual.append(localizer._buffers.state.torque.copy())
    np.testing.assert_allclose(localizer.friction_factors, factor, atol=0.01)
    first, last = (np.abs(part).max() for part in (residual[20:60], residual[-500:]))
    assert first > 10.0 * abs(factor - 1.0) - 1e-9
    assert last < 0.1 + 0.15 * first
    localizer.reset()
    np.testing.assert_array_equal(localizer.friction_factors, 1.0)


@pytest.mark.parametrize(("error", "alarms"), [(ERROR, False), (0.0, True)])
def test_a_factor_within_the_stated_error_is_no_contact(error: float, alarms: bool) -> None:
    factor = 1.0 + 0.15 * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    estimates = Localizer(_scene(error)).run(_swing(factor, 6.0))
    assert any(estimate.contacts for estimate in estimates) is alarms


def test_bias_and_factor_are_told_apart() -> None:
    """A bias keeps its sign where the motion reverses, friction does not."""
    factor = np.array([1.1, 0.9, 1.05, 0.95, 1.1, 0.9])
    localizer = Localizer(_scene(bias_time=2.0))
    for sample in _swing(factor, 30.0, bias=BIAS):
        localizer.step(sample)
    np.testing.assert_allclose(localizer.friction_factors, factor, atol=0.02)
    np.testing.assert_allclose(localizer.biases[1], BIAS, atol=0.12)


def test_the_stated_uncertainty_is_that_of_the_errors() -> None:
    """Over factors drawn as stated, errors in units of their standard deviation have variance one."""
    chance, normalized, localizer = np.random.default_rng(5), [], Localizer(_scene(bias_time=None))
    for seed in range(30):
        factor = 1.0 + ERROR * chance.standard_normal(6)
        for sample in _swing(factor, 1.5, dt=0.008, seed=seed):
            localizer.step(sample)
        found, std = _factors(localizer)
        assert np.all(std < 0.6 * ERROR)
        normalized.append((found - factor) / std)
        localizer.reset()
    # 180 draws: 0.7 and 1.4 are four standard deviations of a mean square apart from one.
    assert 0.6 < np.mean(np.square(normalized)) < 1.5


def test_the_factor_is_held_in_a_contact_and_grows_less_certain() -> None:
    localizer = Localizer(_scene())
    before, after = None, None
    for sample in _swing(np.full(6, 1.1), 10.0, push=(4.0, 60.0)):
        estimate = localizer.step(sample)
        if estimate.contacts and before is None:
            before = _factors(localizer)
        after = _factors(localizer)
    assert before is not None
    assert after is not None
    np.testing.assert_array_equal(before[0], after[0])
    assert np.all(after[1] > before[1])


def test_a_lighter_push_is_found_once_the_factor_is_known() -> None:
    """A force that stays below the uncertainty of friction at first is a contact after seconds of motion."""
    found = {}
    for start in (0.06, 8.0):
        stream = _swing(np.ones(6), start + 0.4, push=(start, 4.0))
        found[start] = any(estimate.contacts for estimate in Localizer(_scene()).run(stream))
    assert found == {0.06: False, 8.0: True}


def test_an_update_causes_no_jump() -> None:
    """Observers go on as if the factor had always been the corrected one."""
    localizer = Localizer(_scene())
    factor, residual = [], []
    for sample in _swing(np.full(6, 1.1), 4.0, dt=0.002, noise=0.0):
        localizer.step(sample)
        factor.append(localizer.friction_factors)
        residual.append(localizer._buffers.state.observers.joints.residual.copy())
    stepped = np.any(np.diff(factor, axis=0) != 0.0, axis=1)
    assert 50 < stepped.sum() < len(factor) / 10
    change = np.abs(np.diff(residual, axis=0))[1:]
    # Friction itself changes by up to 3 % of its range from one sample to the next at a reversal.
    assert change[1:][stepped[:-2]][10:].max() < 0.05


def test_masses_and_friction_together() -> None:
    localizer = Localizer(_scene(inertia_error=0.02))
    for sample in _swing(np.full(6, 1.1), 20.0):
        localizer.step(sample)
    state = localizer._buffers.state
    np.testing.assert_allclose(localizer.friction_factors, 1.1, atol=0.02)
    np.testing.assert_allclose(
        state.model.mass[1:] / localizer._buffers.constants.model.mass[1:], 1.0, atol=0.06
    )
    assert np.linalg.eigvalsh(state.bias_filter.covariance).min() > -1e-9
