"""Pushes on an arm at rest are found by the change of its torques; friction's own changes are not pushes."""

import numpy as np
import pytest

from contactsense.calibration import FreeMotion
from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.contacts.contact_test import suspected_contacts
from contactsense.calibration.contacts.rest_test import changes_at_rest
from contactsense.scene import Scene
from contactsense.sensors.settings import Friction, JointTorqueSensor

COULOMB = np.array([12.0, 12.0, 6.0, 2.0, 2.0, 2.0])
POSTURE = np.array([0.3, -1.2, 1.4, -0.8, 0.7, 0.2])
RATE = 100.0
SCENE = Scene(
    robot="ur5e",
    base_wrench=None,
    joint_torque=JointTorqueSensor(meaning="external", friction=Friction(coulomb=tuple(COULOMB))),
)
ARM = CalibrationModel.of(SCENE)


def at_rest(change: np.ndarray, q: np.ndarray | None = None) -> FreeMotion:
    """An arm at rest whose torques change like that, shape (N, 6) [Nm], besides noise and a constant."""
    noise = 0.2 * np.random.default_rng(1).standard_normal(change.shape)
    positions = np.tile(POSTURE, (len(change), 1)) if q is None else q
    t = np.arange(len(change)) / RATE
    return FreeMotion(t, positions, np.gradient(positions, t, axis=0), 0.5 * COULOMB + change + noise)


def pulse(joint: int, size: float, start: float, stop: float, seconds: float = 12.0) -> np.ndarray:
    """A torque between two times, in units of Coulomb friction, shape (N, 6) [Nm]."""
    t = np.arange(round(seconds * RATE)) / RATE
    change = np.zeros((len(t), 6))
    change[(t >= start) & (t < stop), joint] = size * COULOMB[joint]
    return change


@pytest.mark.parametrize("joint", range(6))
def test_a_push_on_an_arm_at_rest_is_found_where_it_is(joint: int) -> None:
    recording = at_rest(pulse(joint, 2.5, 4.0, 5.5))
    free, (contact,) = suspected_contacts(ARM, recording, SCENE.bandwidth)
    assert contact.start == pytest.approx(4.0, abs=0.5)
    assert contact.stop == pytest.approx(5.5, abs=0.5)
    assert contact.channels[0] == joint
    assert not free[(recording.t > 4.1) & (recording.t < 5.4)].any()
    assert free[(recording.t < 3.5) | (recording.t > 6.0)].all()


def test_a_change_that_friction_may_make_is_no_contact() -> None:
    for joint in range(6):
        below = pulse(joint, 1.3, 4.0, 5.5)
        change, size = changes_at_rest(ARM, at_rest(below), below, 0)
        assert size.max() < 1.0
        assert np.abs(change).max() == pytest.approx(1.3)
    # Above the limit by a single joint, and by two that are below it alone.
    for above in (pulse(0, 1.6, 4.0, 5.5), pulse(0, 1.2, 4.0, 5.5) + pulse(3, 1.2, 4.0, 5.5)):
        assert changes_at_rest(ARM, at_rest(above), above, 0)[1].max() > 1.0


def test_what_friction_holds_after_a_push_is_the_next_reference() -> None:
    """The push shifts friction by 1.2 times Coulomb friction, for good."""
    residual = pulse(1, 4.0, 4.0, 5.0, 20.0) + pulse(1, 1.2, 5.0, 20.0, 20.0)
    size = changes_at_rest(ARM, at_rest(residual), residual, 0)[1]
    t = np.arange(len(residual)) / RATE
    assert (size[(t > 4.0) & (t < 5.0)] > 1.0).all()
    assert not size[t > 8.0].any()


def test_unknown_friction_is_that_of_a_usual_drive() -> None:
    """A recording without motion does not show friction: 3 % of the joint's torque limit is assumed."""
    unknown = ARM.with_values(coulomb=np.zeros(6))
    limit = SCENE.robot.joints[2].torque_limit
    residual = pulse(2, 1.0, 4.0, 5.5) / COULOMB[2] * 0.03 * limit
    change, size = changes_at_rest(unknown, at_rest(residual), 2.0 * residual, 0)
    assert np.abs(change).max() == pytest.approx(2.0)
    assert size.max() == pytest.approx((2.0 / 1.5) ** 2)


def test_motion_and_short_rest_have_no_reference() -> None:
    residual = pulse(1, 5.0, 4.0, 5.5)
    t = np.arange(len(residual)) / RATE
    moving = np.tile(POSTURE, (len(t), 1))
    moving[:, 5] += 0.01 * np.sin(2.0 * np.pi * t)
    creeping = np.tile(POSTURE, (len(t), 1))
    creeping[:, 5] += 0.001 * t
    for q in (moving, creeping):
        assert not changes_at_rest(ARM, at_rest(residual, q), residual, 0)[1].any()
    short = residual[350:540]
    assert not changes_at_rest(ARM, at_rest(short), short, 0)[1].any()
