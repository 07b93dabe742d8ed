"""Friction, bias and the meaning of the torque signal: what is told of them leaves the residual."""

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Sample, Scene
from contactsense.kinematics.inverse_dynamics import inverse_dynamics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.residuals.joint_friction import friction_torque, joint_torque_model, unmodelled_torque_std
from contactsense.scene_model.constants import build_constants
from contactsense.sensors.settings import Friction
from tests.plain_arm import plain_ur5e

JOINTS = 6
FRICTION = Friction(
    coulomb=(8.0, 7.0, 4.0, 1.5, 1.2, 1.0),
    load=0.05,
    viscous=(10.0, 9.0, 5.0, 2.0, 1.5, 1.0),
    lubricant=(3.0, 2.0, 1.0, 0.5, 0.2, 0.1),
    velocity=0.05,
    rest_error=3.0,
)
ROTORS = (4.0, 4.5, 1.5, 0.4, 0.3, 0.3)
BIAS = (0.5, -0.4, 0.3, -0.2, 0.1, 0.05)
SPEED = np.linspace(1.0, 2.5, JOINTS)


def _sensor(**changes: object) -> JointTorqueSensor:
    fields = {"friction": FRICTION, "rotor_inertia": ROTORS, "bias": BIAS, "noise": 0.1, **changes}
    return JointTorqueSensor.model_validate(fields)


def _samples(scene: Scene, signal: str, seconds: float = 0.6) -> list[Sample]:
    """A free motion; the torque signal carries what `signal` says, made of NumPy formulas."""
    model = build_model(scene.robot)._replace(rotor_inertia=np.array(ROTORS))
    motion, torque, wrench, still = empty_motion(JOINTS), np.empty(JOINTS), np.empty(6), np.empty(JOINTS)
    samples = []
    for t in np.arange(0.0, seconds, 0.001):
        q, qd, qdd = np.sin(SPEED * t) - 0.5, SPEED * np.cos(SPEED * t), -(SPEED**2) * np.sin(SPEED * t)
        zero = np.zeros(JOINTS)
        inverse_dynamics(model, q, zero, zero, scene.gravity_base, motion, still, wrench)
        inverse_dynamics(model, q, qd, qdd, scene.gravity_base, motion, torque, wrench)
        dry = np.array(FRICTION.coulomb) + 0.05 * np.abs(still)
        friction = dry * np.tanh(qd / 0.05) + np.array(FRICTION.viscous) * qd
        friction += np.array(FRICTION.lubricant) * np.tanh(qd / FRICTION.lubricant_velocity)
        read = {
            "motor": torque + friction,
            "gravity_free": torque - still + friction,
            "external": np.zeros(JOINTS),
        }[signal]
        samples.append(Sample(t, q, qd, read + BIAS))
    return samples


@pytest.mark.parametrize("meaning", ["motor", "gravity_free", "external"])
def test_residuals_vanish_in_free_motion_for_every_meaning(meaning: str) -> None:
    scene = Scene(robot=plain_ur5e(), base_wrench=None, joint_torque=_sensor(meaning=meaning))
    localizer = Localizer(scene)
    worst = np.zeros(JOINTS)
    for sample in _samples(scene, meaning):
        localizer.step(sample)
        worst = np.maximum(worst, np.abs(localizer._buffers.state.torque))
    assert worst.max() < 0.02  # of torques of some 60 Nm; the quadrature's error


@pytest.mark.parametrize("meaning", ["gravity_free", "external"])
def test_residuals_are_large_for_a_wrong_meaning(meaning: str) -> None:
    scene = Scene(robot=plain_ur5e(), base_wrench=None, joint_torque=_sensor(meaning=meaning))
    localizer = Localizer(scene)
    for sample in _samples(scene, "motor", 0.2):
        localizer.step(sample)
    assert np.abs(localizer._buffers.state.torque).max() > 10.0


def test_friction_acts_against_the_motion_and_grows_with_it() -> None:
    torque_model = joint_torque_model(_sensor(), JOINTS)
    speeds = np.linspace(0.0, 3.0, 50)
    for j in range(JOINTS):
        torques = [friction_torque(torque_model, j, v, -20.0) for v in speeds]
        assert torques[0] == 0.0
        assert np.all(np.diff(torques) > 0.0)
        np.testing.assert_allclose(
            [friction_torque(torque_model, j, -v, -20.0) for v in speeds], np.negative(torques)
        )


def test_reversals_are_less_certain_than_motion() -> None:
    torque_model = joint_torque_model(_sensor(model_error=0.5), JOINTS)
    assert unmodelled_torque_std(torque_model, 0, 0.0) == pytest.approx(np.hypot(3.0, 0.5))
    assert unmodelled_torque_std(torque_model, 0, 1.0) == pytest.approx(0.5, abs=1e-2)
    # At the velocity below which it applies, half of it is left.
    at_limit = unmodelled_torque_std(torque_model, 0, torque_model.rest_velocity)
    assert at_limit == pytest.approx(np.hypot(1.5, 0.5))
    assert unmodelled_torque_std(torque_model, 0, -0.02) == unmodelled_torque_std(torque_model, 0, 0.02)


def test_model_error_adds_to_the_noise_variance() -> None:
    """A torque that the noise alone would call a contact is none while the joint is at rest."""
    q = np.array([0.3, -1.2, 1.4, -1.0, 0.5, 0.2])
    torque = np.array([4.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    for friction, status in ((Friction(), True), (FRICTION, False)):
        sensor = JointTorqueSensor(noise=0.1, friction=friction)
        localizer = Localizer(Scene(robot=plain_ur5e(), base_wrench=None, joint_torque=sensor))
        assert (localizer.locate(q, joint_torque=torque).status != "none") is status


def test_the_scene_replaces_rotors_and_inertia() -> None:
    plain = plain_ur5e()
    heavy = {"mass": 9.0, "com": (0.1, 0.0, 0.0), "tensor": (0.1, 0.0, 0.0, 0.1, 0.0, 0.1)}
    arm = build_constants(
        Scene.model_validate(
            {"robot": plain, "joint_torque": _sensor(rotor_inertia=ROTORS), "inertia": {"forearm": heavy}}
        )
    )
    np.testing.assert_array_equal(arm.model.rotor_inertia, ROTORS)
    assert arm.model.mass[3] == 9.0
    np.testing.assert_array_equal(arm.model.com[3], (0.1, 0.0, 0.0))
    assert arm.model.mass[2] == plain.links[2].inertia.mass
