"""A single measurement that is explained between two samples of a stream leaves the stream as it is."""

import numpy as np

from contactsense import Estimate, JointTorqueSensor, Localizer, Sample, Scene
from contactsense.sensors.settings import Friction
from tests.at_rest import weight
from tests.plain_arm import plain_ur5e

DT, EVERY = 0.002, 5
"""Sample time [s]; the base sensor has a reading in every fifth sample."""
SCENE = Scene(
    robot=plain_ur5e(),
    joint_torque=JointTorqueSensor(noise=0.3, friction=Friction(coulomb=3.0, rest_error=2.0)),
)
"""The error of friction depends on whether a joint moves."""
HOME = np.array([0.0, -1.3, 1.6, -1.9, -1.57, 0.0])


def moving_samples(count: int) -> list[Sample]:
    """An arm that swings, with sensors three times as noisy as stated."""
    chance, samples = np.random.default_rng(0), []
    for i in range(count):
        q = HOME + 0.1 * np.sin(2.0 * np.pi * 0.5 * DT * i)
        qd = np.full(6, 0.1 * np.pi * np.cos(2.0 * np.pi * 0.5 * DT * i))
        torque, wrench = weight(SCENE, q)
        torque = torque + 3.0 * np.tanh(qd / 0.01) + 0.9 * chance.standard_normal(6)
        wrench = wrench + np.repeat([0.75, 0.15], 3) * chance.standard_normal(6)
        samples.append(Sample(DT * i, q, qd, torque, wrench if i % EVERY == 0 else None))
    return samples


def numbers(estimate: Estimate) -> tuple[object, ...]:
    points = [(contact.link, *contact.point, contact.probability) for contact in estimate.contacts]
    return estimate.status, estimate.detectable, estimate.wrench.tolist(), points


def test_it_changes_neither_noise_nor_friction_of_the_stream() -> None:
    localizer, samples = Localizer(SCENE), moving_samples(400)
    expected = [numbers(estimate) for estimate in localizer.run(samples)]
    torque, wrench = weight(SCENE, HOME)
    localizer.reset()
    for sample, numbers_alone in zip(samples, expected, strict=True):
        assert numbers(localizer.step(sample)) == numbers_alone
        localizer.locate(HOME, base_wrench=wrench, joint_torque=torque, external=False)
