"""Velocity and wrench of a sample are not of the same instant, and velocities have noise: neither is taken
for a contact, and contacts that come meanwhile are found."""

import numpy as np
import pytest

from contactsense import Localizer, Sample, Scene, WrenchSensor, robots
from contactsense.service.mock.arm.measured_velocity import measured_velocity
from contactsense.service.mock.arm.newton_euler import inverse_dynamics
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import simulate

DT = 0.002
NOISE = np.repeat([0.25, 0.05], 3)
HOME = np.array([0.0, -1.3, 1.6, -1.9, -1.57, 0.0])
SHARE = np.array([1.0, -0.6, 0.8, 0.9, -1.0, 1.2])
"""Of the joints in the motion."""


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    return Localizer(Scene(robot="ur5e"))


def ramps(chance: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Times (N,), positions, velocities and accelerations (N, 6) of joints whose velocities rise and fall in
    straight ramps. These begin and end at any instant between two samples."""
    acceleration, lasts = [], []
    for sign in np.tile([1.0, -1.0], 12):
        rise, hold = chance.uniform(0.1, 0.2), chance.uniform(0.1, 0.3)
        acceleration += [2.0 * sign, 0.0, -2.0 * sign, 0.0]
        lasts += [rise, hold, rise, hold]
    a = np.array(acceleration)
    begin = np.concatenate(([0.0], np.cumsum(lasts)[:-1]))
    v = np.concatenate(([0.0], np.cumsum(a * lasts)[:-1]))
    x = np.concatenate(([0.0], np.cumsum(v * lasts + 0.5 * a * np.square(lasts))[:-1]))
    t = np.arange(0.0, np.sum(lasts), DT)
    k = np.searchsorted(begin, t, "right") - 1
    d = t - begin[k]
    position, velocity = x[k] + v[k] * d + 0.5 * a[k] * d**2, v[k] + a[k] * d
    return t, HOME + np.outer(position, SHARE), np.outer(velocity, SHARE), np.outer(a[k], SHARE)


@pytest.mark.parametrize("noise", [0.0, 0.0003, 0.001, 0.003])
def test_where_accelerations_jump_there_is_no_contact(localizer: Localizer, noise: float) -> None:
    """As at the end of a ramp of the speed slider; `noise`: of the velocities."""
    chance = np.random.default_rng(0)
    t, q, qd, qdd = ramps(chance)
    torque, base = inverse_dynamics(robots.load("ur5e"), q, qd, qdd)
    qd = measured_velocity(qd, noise, chance)
    torque += chance.standard_normal(torque.shape)
    base += NOISE * chance.standard_normal(base.shape)
    localizer.reset()
    found = [
        localizer.step(Sample(*sample)).status for sample in zip(t.tolist(), q, qd, torque, base, strict=True)
    ]
    assert len(found) > 5000
    assert set(found[100:]) == {"none"}


def test_the_start_of_a_motion_after_creeping_is_no_contact() -> None:
    """A joint that creeps has no noise, which returns when it moves. That of the wrench is a twelfth of the
    usual, so that of the velocities is what counts."""
    sensor = WrenchSensor(force_noise=0.02, moment_noise=0.004)
    localizer = Localizer(Scene(robot="ur5e", base_wrench=sensor, joint_torque=None))
    chance = np.random.default_rng(0)
    ease = 0.5 - 0.5 * np.cos(np.pi * np.arange(100) / 100.0)
    fast = np.concatenate((ease, np.ones(250), ease[::-1]))
    speed = np.concatenate([5e-4 + 0.3 * sign * fast for sign in np.tile([1.0, -1.0], 4)])
    speed = np.insert(speed, np.repeat(450 * np.arange(8), 500), 5e-4)
    path, rate = DT * np.cumsum(speed), np.gradient(speed, DT)
    motion = HOME + np.outer(path, SHARE), np.outer(speed, SHARE), np.outer(rate, SHARE)
    base = inverse_dynamics(robots.load("ur5e"), *motion)[1]
    base += 0.08 * NOISE * chance.standard_normal(base.shape)
    qd = measured_velocity(motion[1], 0.001, chance)
    detectable = []
    for i, sample in enumerate(zip(motion[0], qd, base, strict=True)):
        estimate = localizer.step(Sample(DT * i, sample[0], sample[1], base_wrench=sample[2]))
        assert estimate.status == "none" or i < 100
        detectable.append(estimate.detectable)
    # In each creeping a light touch is detected that the noise of the motion would hide.
    creeping, moving = np.reshape(detectable, (8, 950))[:, [450, 700]].T
    assert (creeping[1:] < 0.2 * moving[1:]).all()


@pytest.mark.parametrize("noise", [0.0003, 0.001, 0.003])
def test_noise_of_the_velocities_is_no_contact_and_hides_none(localizer: Localizer, noise: float) -> None:
    """The stated noise is that of the sensors alone. Real velocities have about 0.001 rad/s."""
    script = Script.demo()
    script = script.model_copy(update={"noise": script.noise.model_copy(update={"joint_velocity": noise})})
    motion = simulate(script)
    localizer.reset()
    onsets, links = [], set()
    for i, t in enumerate(motion.t.tolist()):
        sample = Sample(t, motion.q[i], motion.qd[i], motion.joint_torque[i], motion.base_wrench[i])
        estimate = localizer.step(sample)
        onsets += [t for event in estimate.events if event.kind == "onset"]
        links |= {contact.link for contact in estimate.contacts if estimate.status == "contact"}
        assert estimate.status != "degraded" or t < 0.2
    begins = [contact.start for contact in script.contacts]
    assert len(onsets) == len(begins)
    np.testing.assert_allclose(onsets, begins, atol=0.05)
    assert links == {contact.link for contact in script.contacts}


def test_a_force_that_rises_while_the_arm_moves_is_one_contact(localizer: Localizer) -> None:
    """The velocities of some joints begin to have noise meanwhile, those of others cease to."""
    demo = Script.demo()
    to = [tuple(HOME + 0.5 * SHARE * np.cos(np.arange(6) + k)) for k in range(6)]
    moves = [{"to": end, "duration": 1.6, "dwell": 0.0} for end in to for _ in range(2)]
    pushes = [contact for contact in demo.contacts if contact.push is not None]
    contacts = [
        pushes[k % len(pushes)].model_copy(
            update={"start": 1.0 + 1.2 * k, "duration": 0.9, "ramp": 0.35, "push": 12.0}
        )
        for k in range(14)
    ]
    script = demo.model_copy(
        update={
            "noise": demo.noise.model_copy(update={"joint_velocity": 0.001}),
            "trajectory": type(demo.trajectory).model_validate({"start": tuple(HOME), "moves": moves}),
            "contacts": tuple(contacts),
        }
    )
    motion = simulate(script)
    localizer.reset()
    found = []
    for i, t in enumerate(motion.t.tolist()):
        sample = Sample(t, motion.q[i], motion.qd[i], motion.joint_torque[i], motion.base_wrench[i])
        found += [(t, event.kind) for event in localizer.step(sample).events]
    for contact in contacts:
        end = contact.start + contact.duration
        kinds = [kind for t, kind in found if contact.start <= t < end - 0.1]
        assert kinds[0] == "onset"
        assert not {"release", "resume"} & set(kinds)
    assert [kind for _, kind in found].count("onset") == len(contacts)
