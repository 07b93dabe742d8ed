"""Drifting sensors and wrong masses are followed while nothing touches, and told from a contact."""

from functools import cache

import numpy as np
import pytest
from scipy.stats import chi2

from contactsense import JointTorqueSensor, Localizer, Sample, Scene, WrenchSensor
from contactsense.benchmarks.motion.model_error import heavier, with_drawn_masses
from contactsense.kinematics.inverse_dynamics import inverse_dynamics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.kinematics.wrench_transform import wrench_transform
from contactsense.robots import Robot
from tests.plain_arm import plain_ur5e

ARM = plain_ur5e()
POSTURE = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5])
RATE = np.array([2.0, 1.5, 2.5, 3.0, 2.0, 1.0])
LINK = 3
BASE = WrenchSensor(force_noise=0.25, moment_noise=0.05)
NOISE = np.repeat([0.25, 0.05], 3)
STEADY = np.arange(0.0, 2.0, 0.008)
PAUSED = np.append(STEADY, 62.0 + np.arange(0.0, 0.15, 0.008))
"""Times of samples [s], without and with a pause of a minute."""


def _scene(robot: Robot = ARM, **fields: object) -> Scene:
    return Scene(
        robot=robot,
        base_wrench=BASE,
        joint_torque=JointTorqueSensor(noise=1.0),
        **fields,
    )


@cache
def _free(seconds: float, speed: float = 0.0, dt: float = 0.008, noise: float = 1.0) -> list[Sample]:
    """The arm swings with up to `speed` in each joint, or rests; nothing touches it."""
    model, motion = build_model(ARM), empty_motion(6)
    gravity, chance = Scene(robot=ARM).gravity_base, np.random.default_rng(1)
    torque, wrench = np.empty(6), np.empty(6)
    samples = []
    for t in np.arange(0.0, seconds, dt):
        q = POSTURE + speed / RATE * np.sin(RATE * t)
        qd, qdd = speed * np.cos(RATE * t), -speed * RATE * np.sin(RATE * t)
        inverse_dynamics(model, q, qd, qdd, gravity, motion, torque, wrench)
        tau = torque + noise * chance.standard_normal(6)
        samples.append(Sample(float(t), q, qd, tau, wrench + noise * NOISE * chance.standard_normal(6)))
    return samples


def _changed(samples: list[Sample], torque: np.ndarray, wrench: np.ndarray) -> list[Sample]:
    """The same with something added to torques and base wrench, shapes (6,) or (N, 6)."""
    more, extra = (np.broadcast_to(array, (len(samples), 6)) for array in (torque, wrench))
    return [
        Sample(s.t, s.q, s.qd, np.add(s.joint_torque, a), np.add(s.base_wrench, b))  # type: ignore[arg-type]
        for s, a, b in zip(samples, more, extra, strict=True)
    ]


def _push(force: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What a push on the forearm of the resting arm adds to torques and base wrench; its place."""
    model, motion = build_model(ARM), empty_motion(6)
    kinematics_and_momenta(model, POSTURE, np.zeros(6), np.zeros(3), motion)
    R, o = motion.rotation[LINK], motion.origin[LINK]
    point, f = R @ np.array([-0.2, 0.04, 0.007]) + o, R @ np.array([0.0, -force, 0.0])
    w = np.concatenate((f, np.cross(point, f)))
    return np.where(np.arange(6) < LINK, -motion.screw @ w, 0.0), w, point


@pytest.mark.slow
@pytest.mark.parametrize(("bias_time", "alarms"), [(10.0, False), (None, True)])
def test_a_drift_is_no_contact_and_a_contact_afterwards_is_found(
    bias_time: float | None, alarms: bool
) -> None:
    """0.4 N, 0.08 Nm and 0.8 Nm a minute, for two minutes; then a push of 10 N on top of it."""
    samples = _free(120.0)
    share = np.array([s.t for s in samples])[:, None] / 60.0
    torque, wrench, point = _push(10.0)
    pushed = (np.arange(len(samples)) > len(samples) - 60)[:, None]
    stream = _changed(
        samples,
        share * 0.8 * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0]) + pushed * torque,
        share * np.array([0.4, -0.4, 0.4, 0.08, -0.08, 0.08]) + pushed * wrench,
    )
    estimates = list(Localizer(_scene(bias_time=bias_time)).run(stream))
    assert any(e.contacts for e in estimates[:-60]) is alarms
    if not alarms:
        assert sum(event.kind == "onset" for e in estimates for event in e.events) == 1
        assert estimates[-1].contacts[0].link_index == LINK
        assert np.linalg.norm(estimates[-1].contacts[0].point_base - point) < 0.03


def test_the_filter_holds_during_a_contact() -> None:
    """A push of 20 N that lasts a minute, six times as long as biases are averaged, stays what it is."""
    samples = _free(70.0)
    torque, wrench, _ = _push(20.0)
    on = (np.arange(len(samples)) > 0.1 * len(samples))[:, None]
    localizer = Localizer(_scene())
    force = [
        float(np.linalg.norm(e.wrench[:3]))
        for e in localizer.run(_changed(samples, on * torque, on * wrench))
    ]
    early, late = np.mean(force[1500:2500]), np.mean(force[-1000:])
    assert late == pytest.approx(early, abs=0.05)
    assert early == pytest.approx(20.0, abs=0.2)


@pytest.mark.parametrize(("told", "alarms"), [(0.02, False), (0.0, True)])
def test_mass_errors_within_the_stated_uncertainty_are_no_contact(told: float, alarms: bool) -> None:
    estimates = Localizer(_scene(heavier(ARM, 0.02), inertia_error=told)).run(_free(6.0, 0.6))
    assert any(e.contacts for e in estimates) is alarms


def test_estimated_masses_fit_and_are_reset_with_the_stream() -> None:
    """Without noise: the residual of a moving arm with masses 2 % off all but vanishes."""
    localizer = Localizer(_scene(heavier(ARM, 0.02), inertia_error=0.02))
    state = localizer._buffers.state
    first, last = [], []
    for i, sample in enumerate(_free(6.0, 0.6, noise=0.0)):
        localizer.step(sample)
        # Nothing is learned before the observer has settled, in the tenth sample.
        (first if i < 9 else last).append(np.abs(state.base_wrench[3:]).max())
    assert max(first) > 0.3
    assert max(last[-200:]) < 0.02
    localizer.reset()
    np.testing.assert_array_equal(state.model.mass, localizer._buffers.constants.model.mass)
    np.testing.assert_array_equal(state.bias_filter.bias, 0.0)
    assert np.trace(state.bias_filter.covariance[12:, 12:]) == pytest.approx(6 * 0.02**2)


def test_estimated_masses_are_as_uncertain_as_stated() -> None:
    """The squared error in units of the stated covariance is that of chi-square, with masses 10 % off. A mass
    that has hardly turned looks like a bias: what cannot be told apart must not seem to be known."""
    told, draws, squared = 0.1, 6, 0.0
    exact = Scene(robot=ARM, base_wrench=BASE, joint_torque=None)
    for seed in range(draws):
        localizer = Localizer(with_drawn_masses(exact, told, seed))
        for sample in _free(4.0, 0.6):
            localizer.step(sample)
        state = localizer._buffers.state
        error = np.array([x.inertia.mass for x in ARM.links])[1:] / state.model.mass[1:] - 1.0
        covariance = state.bias_filter.covariance[18:24, 18:24]
        assert np.sqrt(covariance.diagonal()).min() < 0.1 * told, "some of them are known"
        squared += error @ np.linalg.solve(covariance, error)
    assert chi2.isf(0.999, 6 * draws) < squared < chi2.isf(0.001, 6 * draws)


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (0.3, 0.1, -0.6)])
@pytest.mark.parametrize("times", [STEADY, PAUSED], ids=["steady", "paused"])
def test_biases_are_as_uncertain_as_stated(place: tuple[float, float, float], times: np.ndarray) -> None:
    """Biases wander as the scene says, also in a pause of the stream. Squared errors of forces and of moments
    about the sensor, in units of their covariance, are those of chi-square: a sensor that sits elsewhere than
    the base has noise of forces and moments about the base's origin together."""
    base, draws, free = BASE.model_copy(update={"translation": place}), 20, _free(0.008, noise=0.0)[0]
    scene = Scene(robot=ARM, base_wrench=base, joint_torque=None)
    assert scene.bias_time is not None
    assert free.base_wrench is not None
    localizer, to_base = Localizer(scene), wrench_transform(np.eye(3), np.array(place))
    walk = np.sqrt(np.diff(times, prepend=0.0) * 0.008)[:, None] / scene.bias_time
    found, squared, to_sensor = localizer._buffers.state.bias_filter, np.zeros(2), np.linalg.inv(to_base)
    for seed in range(draws):
        localizer.reset()
        chance = np.random.default_rng(seed)
        noise, steps = NOISE * chance.standard_normal((2, len(times), 6))
        bias = np.cumsum(walk * steps, axis=0)
        for t, wrench in zip(times, free.base_wrench + (bias + noise) @ to_base.T, strict=True):
            localizer.step(Sample(float(t), free.q, free.qd, None, wrench))
        error, covariance = (
            to_sensor @ found.bias - bias[-1],
            to_sensor @ found.covariance[:6, :6] @ to_sensor.T,
        )
        for part, of in enumerate((slice(3), slice(3, 6))):
            squared[part] += error[of] @ np.linalg.solve(covariance[of, of], error[of])
    assert chi2.isf(0.9999, 3 * draws) < squared.min()
    assert squared.max() < chi2.isf(0.0001, 3 * draws)


def test_an_update_of_the_filter_causes_no_jump() -> None:
    """Observers go on as if the model had always been the corrected one: the residual does not jump."""
    localizer = Localizer(_scene(heavier(ARM, 0.02), inertia_error=0.02))
    state = localizer._buffers.state
    mass, left = [], []
    for sample in _free(4.0, 0.6, 0.002, noise=0.0):
        localizer.step(sample)
        mass.append(state.model.mass.copy())
        left.append(
            np.concatenate((state.base_wrench, state.torque, state.observers.torque_difference.residual))
        )
    stepped = np.any(np.diff(mass, axis=0) != 0.0, axis=1)
    assert 50 < stepped.sum() < len(mass) / 10
    # The sample of the step itself still shows the old residual; from the next on nothing may ring.
    change = np.abs(np.diff(left, axis=0))[1:]
    after = change[1:][stepped[:-2]][5:]
    assert after.max() < 0.02


def test_model_uncertainty_widens_the_covariance() -> None:
    """A push right after the start is as sure as the masses let it be."""
    samples = _free(0.4, dt=0.002)
    torque, wrench, _ = _push(20.0)
    spread = []
    for told in (0.0, 0.02):
        on = (np.arange(len(samples)) > 35)[:, None]  # before anything can have been learned
        last = list(Localizer(_scene(inertia_error=told)).run(_changed(samples, on * torque, on * wrench)))[
            -1
        ]
        spread.append(np.sqrt(np.trace(last.contacts[0].covariance)))
    assert spread[1] > 2.0 * spread[0]
