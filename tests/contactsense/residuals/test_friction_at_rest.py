"""Pushes that a resting joint's friction could hold are told from friction, and nothing else is."""

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Sample, Scene
from contactsense.detection.false_alarm_rate import onset_threshold, release_threshold
from contactsense.residuals.friction_at_rest import (
    BREAKAWAY_TIME,
    PRESLIDING_DISPLACEMENT,
    FrictionAtRest,
    TorqueVariance,
    energy_beyond_static_friction,
)
from contactsense.residuals.joint_friction import JointTorqueModel, friction_torque, joint_torque_model
from contactsense.residuals.momentum_observer import noise_variance_ratio
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.sensors.settings import Friction
from tests.at_rest import weight
from tests.plain_arm import plain_ur5e

COULOMB, INERTIA, NOISE, DT, BANDWIDTH = 11.5, 10.0, 1.7, 0.01, 10.0
SENSOR = JointTorqueSensor(
    noise=NOISE, friction=Friction(coulomb=COULOMB, velocity=0.01, rest_error=4.6), model_error=1.0
)
BARE = joint_torque_model(JointTorqueSensor(noise=NOISE), 1)
LIMITS = (onset_threshold(0.01, 6, BANDWIDTH, DT), release_threshold(6))


def _joint(
    seconds: float, speed: list[tuple[float, float]], push: list[tuple[float, float]], seed: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """A joint that rubs (Dahl's friction: a spring that yields) under a controller that follows a speed, as
    stiff as the UR10e's first joint, which 23 Nm move by 0.2 mrad: its positions [rad], and the torque beyond
    its model, low-passed and noisy [Nm], every DT. `speed`, `push`: times and values between which it is
    linear [rad/s, Nm]."""
    fine, ratio = 1e-3, round(DT / 1e-3)
    t = np.arange(0.0, seconds, fine)
    wanted = np.interp(t, *zip(*speed, strict=True))
    pushed = np.interp(t, *zip(*push, strict=True))
    torque_model, chance = joint_torque_model(SENSOR, 1), np.random.default_rng(seed)
    stiffness = COULOMB / PRESLIDING_DISPLACEMENT
    q, qd, target, held, friction, seen = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    positions, torques = [], []
    for i in range(len(t)):
        target += fine * wanted[i]
        held += fine * (target - q)
        motor = 1.15e5 * (target - q) + 1.5e3 * (wanted[i] - qd) + 2e5 * held
        friction += fine * stiffness * qd * (1.0 - np.sign(qd) * friction / COULOMB)
        qd += fine * (motor + pushed[i] - friction) / INERTIA
        q += fine * qd
        left = pushed[i] - friction + friction_torque(torque_model, 0, qd, 0.0)
        if i % ratio == 0:
            read = left + NOISE * chance.standard_normal()
            seen += (1.0 - np.exp(-2.0 * np.pi * BANDWIDTH * DT)) * (read - seen)
            positions.append(q)
            torques.append(seen)
    return np.array(positions), np.array(torques)


def _energies(q: np.ndarray, torque: np.ndarray, torque_model: JointTorqueModel | None = None) -> np.ndarray:
    state, torque_model = zeros(FrictionAtRest, joints=1), torque_model or joint_torque_model(SENSOR, 1)
    variance = TorqueVariance(np.array([NOISE**2]), noise_variance_ratio(BANDWIDTH, DT), np.zeros(1))
    energies, touched = [], False
    for i, (position, value) in enumerate(zip(q, torque, strict=True)):
        energy = energy_beyond_static_friction(
            state, torque_model, np.array([position]), np.array([value]), variance, DT * (i > 0), touched,
            LIMITS, BANDWIDTH,
        )  # fmt: skip
        touched = energy > (LIMITS[1] if touched else LIMITS[0])
        energies.append(energy)
    return np.array(energies)


@pytest.mark.parametrize("torque", [-11.0, 11.0])
@pytest.mark.parametrize("rested", [5.0, 12.0])
def test_a_push_below_coulomb_friction_is_detected_while_it_lasts(torque: float, rested: float) -> None:
    """It rises within 0.3 s and lasts for one more."""
    q, seen = _joint(
        rested + 3.5,
        [(0.0, 0.0)],
        [(rested, 0.0), (rested + 0.3, torque), (rested + 1.3, torque), (rested + 1.4, 0.0)],
    )
    on = np.flatnonzero(_energies(q, seen)) * DT
    assert rested + BREAKAWAY_TIME < on[0] < rested + 0.3 + 1.5 * BREAKAWAY_TIME
    assert rested + 1.25 < on[-1] < rested + 1.6
    assert len(on) == round((on[-1] - on[0]) / DT) + 1


@pytest.mark.parametrize("acceleration", [-1.0, -0.1, 0.03, 0.3])
def test_starting_and_stopping_is_no_contact(acceleration: float) -> None:
    """Friction turns round by more than the push above; after the stop it creeps."""
    speed = 0.2 * np.sign(acceleration)
    ramp = speed / acceleration
    course = [(1.5, 0.0), (1.5 + ramp, speed), (2.0 + ramp, speed), (2.0 + 2.0 * ramp, 0.0)]
    q, seen = _joint(5.0 + 2.0 * ramp, course, [(0.0, 0.0)])
    assert np.ptp(seen) > 8.0
    assert not _energies(q, seen).any()


@pytest.mark.slow
def test_noise_and_creep_of_an_hour_are_no_contact() -> None:
    """Friction after a stop relaxes from all that it may hold, over one, five and thirty seconds at once;
    meanwhile it drifts by 0.8 Nm a minute."""
    rng, n = np.random.default_rng(1), 360_000
    t = DT * np.arange(n)
    truth = sum(COULOMB / 3.0 * np.exp(-t / tau) for tau in (1.0, 5.0, 30.0)) + 0.8 / 60.0 * t
    seen, keep = np.empty(n), np.exp(-2.0 * np.pi * BANDWIDTH * DT)
    last = truth[0]
    for i, read in enumerate(truth + NOISE * rng.standard_normal(n)):
        last = seen[i] = keep * last + (1.0 - keep) * read
    assert not _energies(np.zeros(n), seen).any()


def test_without_friction_a_step_is_detected() -> None:
    """Without anything unexplained at rest the energy is that of the residual itself, less what noise makes
    uncertain of the level before."""
    seen = np.where(np.arange(200) < 100, 0.0, 7.0)
    energies = _energies(np.zeros(200), seen, BARE)
    expected = 0.5 * 7.0**2 / (NOISE**2 * noise_variance_ratio(BANDWIDTH, DT))
    first = np.flatnonzero(energies)[0]
    assert 100 + round(BREAKAWAY_TIME / DT) - 1 <= first <= 100 + round(BREAKAWAY_TIME / DT)
    assert ((energies[first:] > 0.75 * expected) & (energies[first:] < expected)).all()


@pytest.mark.parametrize(("share", "ends"), [(0.4, True), (0.6, False)])
def test_a_contact_ends_when_less_than_half_of_its_torque_is_left(share: float, ends: bool) -> None:
    """Friction holds the rest, so the torque need not come back to what it was."""
    seen = np.repeat([0.0, 20.0, 20.0 * share], 100)
    energies = _energies(np.zeros(300), seen, BARE)
    assert (energies[150:200] > 0.0).all()
    assert energies[200:].any() == (not ends)


def test_a_deviation_may_fall_below_the_onset_threshold_before_it_is_a_contact() -> None:
    """Not below the release threshold, though: that begins the time anew."""
    variance = NOISE**2 * noise_variance_ratio(BANDWIDTH, DT)
    onset, release = (np.sqrt(2.0 * limit * variance) for limit in LIMITS)
    first = {}
    for dip in (2.0 * onset, 0.5 * (onset + release), 0.5 * release):
        seen = np.where(np.arange(200) < 100, 0.0, 2.0 * onset)
        seen[110] = dip
        first[dip] = np.flatnonzero(_energies(np.zeros(200), seen, BARE))[0]
    steady, shallow, deep = first.values()
    assert shallow == steady
    assert deep == steady + 11


def test_after_a_contact_that_something_else_told_the_references_are_new() -> None:
    """What friction holds since then is nothing that still pushes."""
    state = zeros(FrictionAtRest, joints=1)
    variance = TorqueVariance(np.array([NOISE**2]), noise_variance_ratio(BANDWIDTH, DT), np.zeros(1))
    energies = [
        energy_beyond_static_friction(
            state, BARE, np.zeros(1), np.array([20.0 * (i >= 100)]), variance, DT * (i > 0), 100 <= i < 200,
            LIMITS, BANDWIDTH,
        )
        for i in range(300)
    ]  # fmt: skip
    assert energies[199] > 0.0
    assert not any(energies[200:])


@pytest.mark.parametrize("samples", [150, 800])
def test_variance_of_a_reference(samples: int) -> None:
    """That of the mean of low-passed noise, whose correlation falls off with its cut-off frequency."""
    state = zeros(FrictionAtRest, joints=1)
    variance = TorqueVariance(np.array([NOISE**2]), noise_variance_ratio(BANDWIDTH, DT), np.zeros(1))
    for i in range(samples):
        energy_beyond_static_friction(
            state, BARE, np.zeros(1), np.zeros(1), variance, DT * (i > 0), False, LIMITS, BANDWIDTH
        )
    for mean in state.slices[1:]:
        t = np.linspace(0.0, mean.duration, 1001)[1:] - mean.duration / 2000.0
        correlation = np.exp(-2.0 * np.pi * BANDWIDTH * np.abs(t[:, None] - t))
        assert mean.variance_ratio == pytest.approx(correlation.mean(), rel=0.02)


def test_a_stream_of_torques_detects_it_on_one_joint_at_rest() -> None:
    """12 Nm on the first joint of a UR5e whose friction holds 11.5; with all neighbours at rest."""
    arm = plain_ur5e()
    scene = Scene(robot=arm, base_wrench=None, joint_torque=SENSOR)
    q, zero = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5]), np.zeros(6)
    own, _ = weight(scene, q)
    chance, offset = np.random.default_rng(4), np.array([4.0, -6.0, 3.0, 1.0, -2.0, 1.0])
    localizer, events = Localizer(scene), []
    for t in np.arange(0.0, 4.0, DT):
        torque = own + offset + NOISE * chance.standard_normal(6)
        torque[0] += np.interp(t, [2.0, 2.2, 2.8, 2.9], [0.0, 12.0, 12.0, 0.0])
        events += localizer.step(Sample(float(t), q, zero, torque)).events
    ends = [(event.kind, event.t) for event in events if event.kind in ("onset", "release")]
    assert [kind for kind, _ in ends] == ["onset", "release"]
    assert 2.0 + BREAKAWAY_TIME < ends[0][1] < 2.5
    assert 2.8 < ends[1][1] < 3.0
