"""Contacts of several at once push on the surface at their places."""

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Scene, WrenchSensor, robots
from contactsense.robots.primitives import Capsule, Primitive, Sphere
from tests.plain_arm import contacts, ur5e_of

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


def test_sensors_that_are_nearly_exact_leave_contacts_that_push_and_covariances() -> None:
    """Sums over pairs of places are then differences of huge numbers."""
    bare: tuple[Primitive, ...] = ()
    arm = ur5e_of(
        [
            *(bare, bare, (Capsule(a=(-0.05, 0, 0.1), b=(-0.34, 0, 0.1), radius=0.04),), bare, bare, bare),
            (Sphere(center=(0, 0, 0.5), radius=0.4), Sphere(center=(0, 0, 0.91), radius=0.005)),
        ]
    )
    localizer = Localizer(
        Scene(
            robot=arm,
            base_wrench=WrenchSensor(force_noise=1e-7, moment_noise=2e-8),
            joint_torque=JointTorqueSensor(noise=3e-7),
        )
    )
    truth, count = contacts(arm, 40, seed=7, friction=1.0, torsion=0.01), 0
    for q, wrench, torque in zip(truth.q, truth.base_wrench, truth.torque, strict=True):
        # With a moment that no single push explains.
        wrench = wrench * np.repeat((1.0, 0.0), 3)
        estimate = localizer.locate(q, base_wrench=wrench, joint_torque=torque, contacts=2, detect=False)
        for contact in (c for explanation in estimate.explanations for c in explanation.contacts):
            count += 1
            assert np.isfinite(contact.covariance).all()
            assert contact.force_base @ contact.normal_base < 0.0
    assert count > 10
