"""Contacts of several at once push on the surface at their places."""

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Scene, robots
from tests.plain_arm import contacts

pytestmark = pytest.mark.slow  # its kernels compile for long

ARM = robots.load("ur5e")
TRUTH = contacts(ARM, 200, seed=5)


@pytest.mark.parametrize("drift", [0.5, None])
def test_earlier_contacts_push_however_broad_their_places_are(drift: float | None) -> None:
    localizer = Localizer(Scene(robot=ARM, joint_torque=JointTorqueSensor(noise=0.3)))
    rng, count = np.random.default_rng(4), 0
    for q, torque in zip(TRUTH.q, TRUTH.torque, strict=True):
        first = localizer.locate(q, joint_torque=torque, detect=False)
        if not first.contacts:
            continue
        then = torque + 2.0 * rng.standard_normal(6)
        estimate = localizer.locate(
            q, joint_torque=then, detect=False, contacts=2, known=first.contacts[:1], drift=drift
        )
        for contact in estimate.contacts:
            count += 1
            assert contact.force_base @ contact.normal_base < 0.0
    assert count > 50
