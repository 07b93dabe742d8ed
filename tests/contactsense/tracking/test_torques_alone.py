"""With joint torques alone, all samples since the onset of a contact choose the answer."""

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Sample, Scene
from contactsense.kinematics.inverse_dynamics import inverse_dynamics
from contactsense.kinematics.model import build_model, empty_motion
from tests.plain_arm import plain_ur5e

ARM = plain_ur5e()
START = 0.3
"""When the contact begins [s]."""


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    return Localizer(Scene(robot=ARM, base_wrench=None, joint_torque=JointTorqueSensor(noise=1.0)))


def _samples(seconds: float, link: int, point: np.ndarray, normal: np.ndarray, seed: int) -> list[Sample]:
    """A push of 25 N on an arm that moves, at a place in the frame of a link."""
    model, motion = build_model(ARM), empty_motion(6)
    gravity, torque, wrench = Scene(robot=ARM).gravity_base, np.empty(6), np.empty(6)
    chance = np.random.default_rng(seed)
    samples = []
    for t in np.arange(0.0, seconds, 0.002):
        rate = np.array([2.0, 1.5, 2.5, 3.0, 2.0, 1.0])
        q = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5]) + 1.2 / rate * np.sin(rate * t)
        qd, qdd = 1.2 * np.cos(rate * t), -1.2 * rate * np.sin(rate * t)
        inverse_dynamics(model, q, qd, qdd, gravity, motion, torque, wrench)
        if t >= START:
            R, o = motion.rotation[link], motion.origin[link]
            force = -25.0 * min((t - START) / 0.05, 1.0) * (R @ normal)
            w = np.concatenate((force, np.cross(R @ point + o, force)))
            torque[:link] -= motion.screw[:link] @ w
        samples.append(Sample(float(t), q, qd, torque + chance.standard_normal(6)))
    return samples


def test_all_samples_since_the_onset_count(localizer: Localizer) -> None:
    """A second of contact is fifty blocks; the forearm, which is touched, is the answer at the end of it."""
    localizer.reset()
    place = np.array([-0.25, 0.04, 0.007]), np.array([0.0, 1.0, 0.0])
    for sample in _samples(START + 1.0, 3, *place, seed=0):
        estimate = localizer.step(sample)
    assert localizer._buffers.state.places.status[0].blocks > 40
    assert estimate.contacts[0].link_index == 3
    total = sum(contact.probability for contact in estimate.contacts) + estimate.other
    assert total == pytest.approx(1.0)
