"""A weight that is picked up is told from a push, carried along, and put down again."""

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.stats import chi2

from contactsense import JointTorqueSensor, Localizer, Sample, Scene, WrenchSensor
from contactsense.kinematics.inverse_dynamics import inverse_dynamics
from contactsense.kinematics.model import Model, build_model, empty_motion
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.residuals.bias_filter import masses, payload_place
from contactsense.residuals.payload_error import HEIGHT_STD
from contactsense.robots.tool import Tool
from contactsense.runtime.picked_up_payload import CHECK_INTERVAL
from contactsense.scene_model.arm_model import model_with_tool
from tests.plain_arm import plain_ur5e

ARM = plain_ur5e()
POSTURE = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5])
DT = 0.004
MASS = 1.5
NOISE = np.repeat([0.25, 0.05], 3)
ESTIMATES = slice(masses(6) + 5, payload_place(6) + 3)
"""Mass of the last link with its payload, and place of the payload, among what the filter estimates."""


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    return Localizer(
        Scene(
            robot=ARM,
            base_wrench=WrenchSensor(force_noise=0.25, moment_noise=0.05),
            joint_torque=JointTorqueSensor(noise=1.0),
            picks_up=True,
        )
    )


def _loaded(com: Sequence[float]) -> Model:
    """The arm with the weight, whose centre of mass is there in the flange's frame."""
    return model_with_tool(Scene(robot=ARM, tool=Tool(mass=MASS, com=tuple(com))))


def _sample(t: float, model: Model, motion: Sequence[np.ndarray], chance: np.random.Generator) -> Sample:
    """Noisy readings of an arm; `motion`: its positions, velocities and accelerations."""
    torque, wrench, gravity = np.empty(6), np.empty(6), Scene(robot=ARM).gravity_base
    inverse_dynamics(model, *motion, gravity, empty_motion(6), torque, wrench)
    noise = chance.standard_normal((2, 6))
    return Sample(float(t), motion[0], motion[1], torque + noise[0], wrench + NOISE * noise[1])


def _stream(
    seconds: float, carried: tuple[float, float], swing: tuple[float, float] = (0.0, 0.0)
) -> list[Sample]:
    """A weight hangs at the flange from and until; the shoulder turns back and forth from and until."""
    chance, bare, heavy, samples = np.random.default_rng(3), build_model(ARM), _loaded((0.02, -0.01, 0.0)), []
    for t in np.arange(0.0, seconds, DT):
        q, qd, qdd = POSTURE.copy(), np.zeros(6), np.zeros(6)
        if swing[0] <= t < swing[1]:
            s, c = np.sin(t - swing[0]), np.cos(t - swing[0])
            q[0] += 0.2 * (1.0 - c) ** 2
            qd[0], qdd[0] = 0.4 * (1.0 - c) * s, 0.4 * (s * s + (1.0 - c) * c)
        model = heavy if carried[0] <= t < carried[1] else bare
        samples.append(_sample(t, model, (q, qd, qdd), chance))
    return samples


def _tilted(place: np.ndarray, seed: int) -> list[Sample]:
    """A weight hangs there almost from the start, in the last link's frame; then the wrist turns, so that the
    weight pulls in other directions of the link."""
    flange = ARM.flange_rotation.T @ (place - ARM.flange_translation)
    chance, bare, heavy, samples = np.random.default_rng(seed), build_model(ARM), _loaded(flange), []
    turn = np.array([0.0, 0.0, 0.0, 0.8, 0.8, 0.0])
    for t in np.arange(0.0, 3.2, DT):
        s = np.clip((t - 1.5) / 1.5, 0.0, 1.0)
        angle, rate, change = (
            s**3 * (10 - 15 * s + 6 * s**2),
            30 * (s - s**2) ** 2,
            60 * s - 180 * s**2 + 120 * s**3,
        )
        motion = POSTURE + angle * turn, rate / 1.5 * turn, change / 1.5**2 * turn
        samples.append(_sample(t, heavy if t > 0.3 else bare, motion, chance))
    return samples


def _with_push(samples: list[Sample], angle: float, since: float, until: float) -> list[Sample]:
    """The same, with a push on the flange as strong as the weight, at that angle to gravity [rad]."""
    model, motion = build_model(ARM), empty_motion(6)
    torque, wrench = np.empty(6), np.empty(6)
    inverse_dynamics(model, POSTURE, np.zeros(6), np.zeros(6), np.zeros(3), motion, torque, wrench)
    f = 9.81 * MASS * np.array([np.sin(angle), 0.0, -np.cos(angle)])
    w = np.concatenate((f, np.cross(motion.origin[6], f)))
    return [
        Sample(s.t, s.q, s.qd, np.subtract(s.joint_torque, motion.screw @ w), np.add(s.base_wrench, w))  # type: ignore[arg-type]
        if since < s.t < until
        else s
        for s in samples
    ]


def test_a_payload_is_picked_up_carried_and_put_down(localizer: Localizer) -> None:
    turn = 2.0 * np.pi
    estimates = list(localizer.run(_stream(4.4 + turn, (1.0, 3.0 + turn), (2.5, 2.5 + turn))))
    weights = [(event.t, event.mass) for e in estimates for event in e.events if event.kind == "weight"]
    # Said within a second.
    assert [t for t, _ in weights] == pytest.approx([1.9, 3.9 + turn], abs=0.2)
    assert weights[0][1] == pytest.approx(MASS, abs=0.03)
    assert weights[1][1] == pytest.approx(-MASS, abs=0.03)
    # What it is not taken for while it is carried: a contact.
    assert not any(e.contacts for e in estimates if weights[0][0] < e.t < 2.95 + turn)
    assert estimates[-1].status == "none"
    assert localizer._payload is not None
    assert localizer._payload.mass == 0.0
    np.testing.assert_array_equal(
        localizer._buffers.state.model.mass, localizer._buffers.constants.model.mass
    )


@pytest.mark.slow
def test_a_payload_is_known_as_well_as_stated(localizer: Localizer) -> None:
    """Its height, which no posture tells, is found when it tilts, which is no contact. Squared errors of mass
    and place in units of the stated covariance are those of chi-square, before and after."""
    exact = Localizer(localizer.scene.model_copy(update={"bias_time": None}))
    state, draws, squared, motion = exact._buffers.state, 20, np.zeros(2), empty_motion(6)
    kinematics_and_momenta(build_model(ARM), POSTURE, np.zeros(6), np.zeros(3), motion)
    mass = ARM.links[-1].inertia.mass + MASS
    for seed in range(draws):
        exact.reset()
        offset = np.array([0.05, 0.05, HEIGHT_STD]) * np.random.default_rng(seed).standard_normal(3)
        place = ARM.flange_translation + motion.rotation[-1].T @ offset
        samples = _tilted(place, seed)
        for after, part in enumerate((samples[: round(1.5 / DT)], samples[round(1.5 / DT) :])):
            contacts = [exact.step(sample).contacts for sample in part]
            assert not (after and any(contacts))
            error = np.append(mass / state.model.mass[-1] - 1.0, place - state.bias_filter.payload_place)
            covariance = state.bias_filter.covariance[ESTIMATES, ESTIMATES]
            squared[after] += error @ np.linalg.solve(covariance, error)
            height = np.sqrt(np.linalg.eigvalsh(covariance[1:, 1:])[-1])
            assert height < 2e-3 if after else height > 0.99 * HEIGHT_STD
    assert chi2.isf(0.999, 4 * draws) < squared.min()
    assert squared.max() < chi2.isf(0.001, 4 * draws)


@pytest.mark.slow
@pytest.mark.parametrize("height", [-0.2, 0.2])
def test_a_payload_far_from_the_flange_is_no_contact_when_the_wrist_jerks(
    localizer: Localizer, height: float
) -> None:
    """Its moment of inertia is quadratic in its height, which is not known until it moves."""
    motion = empty_motion(6)
    kinematics_and_momenta(build_model(ARM), POSTURE, np.zeros(6), np.zeros(3), motion)
    place = motion.rotation[-1].T @ np.array([0.02, -0.02, height])
    bare, heavy = build_model(ARM), _loaded(ARM.flange_rotation.T @ place)
    wrist = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    for seed in range(12):
        chance = np.random.default_rng(seed)
        begins = 2.2 + DT * chance.uniform()
        localizer.reset()
        found = []
        for t in np.arange(0.0, 3.4, DT):
            # The acceleration jumps to one side, to the other, and back.
            since = np.maximum(t - begins - np.array([0.0, 0.25, 0.75, 1.0]), 0.0)
            jumps = 6.0 * np.array([1.0, -2.0, 2.0, -1.0])
            angle, rate, change = jumps @ since**2 / 2.0, jumps @ since, jumps @ (since > 0.0)
            moved = POSTURE + angle * wrist, rate * wrist, change * wrist
            estimate = localizer.step(_sample(t, heavy if t > 0.5 else bare, moved, chance))
            found += [(event.kind, t) for event in estimate.events]
        assert [kind for kind, t in found if kind == "weight" and t < begins] == ["weight"]
        assert not [t for kind, t in found if kind == "onset" and t > begins]


def test_the_last_link_is_as_uncertain_as_before_once_the_payload_is_put_down(localizer: Localizer) -> None:
    """What is known of link and payload together says little of the link."""
    plain = Localizer(localizer.scene.model_copy(update={"inertia_error": 0.05}))
    found, last, variances = plain._buffers.state.bias_filter, ESTIMATES.start, []
    for sample in _stream(5.0, (1.0, 3.0)):
        variances.append(found.covariance[last, last])
        weights = [event.mass for event in plain.step(sample).events if event.kind == "weight"]
        if weights and weights[0] < 0.0:
            break
    assert weights[0] == pytest.approx(-MASS, abs=0.03)
    assert variances[-1] < 0.1 * variances[round(1.5 / DT)]
    assert found.covariance[last, last] == pytest.approx(variances[round(1.5 / DT)], rel=1e-9)
    assert found.status[0].payload_mass == 0.0
    assert not found.covariance[last + 1 :].any()


@pytest.mark.parametrize("angle", [0.15, 0.4])
def test_a_push_not_along_gravity_remains_a_contact(localizer: Localizer, angle: float) -> None:
    """As strong as the weight, at the flange, but not quite along gravity."""
    pushed = _with_push(_stream(3.0, (9.0, 9.0)), angle, 1.0, 9.0)
    estimates = list(localizer.run(pushed))
    assert not any(event.kind == "weight" for e in estimates for event in e.events)
    assert estimates[-1].contacts or estimates[-1].other > 0.5


def test_a_long_contact_before_does_not_delay_the_test_of_a_payload(localizer: Localizer) -> None:
    """At this bandwidth a contact holds its position only when it is old enough for a test already."""
    slow = Localizer(localizer.scene.model_copy(update={"bandwidth": 2.0}))
    alone = _stream(11.0, (7.0, 99.0))
    after_push = _with_push(alone, 0.4, 1.0, 5.0)
    first, second = (
        [event.t for e in slow.run(samples) for event in e.events if event.kind == "weight"]
        for samples in (alone, after_push)
    )
    assert len(first) == 1
    assert second == pytest.approx(first, abs=CHECK_INTERVAL)


def test_a_payload_is_a_contact_without_picks_up(localizer: Localizer) -> None:
    plain = Localizer(localizer.scene.model_copy(update={"picks_up": False}))
    estimates = list(plain.run(_stream(3.0, (1.0, 9.0))))
    assert {event.kind for e in estimates for event in e.events} <= {"onset", "hold", "slide"}
    assert estimates[-1].status != "none"


def test_it_needs_both_sensors() -> None:
    with pytest.raises(ValueError, match="picks_up: expected base_wrench and joint_torque"):
        Scene(robot=ARM, base_wrench=None, picks_up=True)
