"""Poses, screws, momenta and inverse dynamics, held against Pinocchio on arms without symmetry."""

import os
import subprocess
import sys

import numpy as np
import pinocchio as pin
import pytest

from contactsense import Scene, robots
from contactsense.kinematics.inverse_dynamics import inverse_dynamics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.kinematics.momenta import kinematics_and_momenta
from tests.oracles.pinocchio_arm import PinocchioArm
from tests.oracles.random_arm import random_arm

ARMS = [random_arm(seed, joints) for seed, joints in enumerate((1, 2, 6, 7, 9))] + [
    robots.load("ur5e"),
    robots.load("ur10e"),
]


def _state(seed: int, joints: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    chance = np.random.default_rng(seed)
    return (
        chance.uniform(-np.pi, np.pi, joints),
        chance.standard_normal(joints) * 2.0,
        chance.standard_normal(joints) * 5.0,
    )


@pytest.mark.parametrize("arm", ARMS, ids=lambda arm: f"{arm.name}-{len(arm.joints)}")
@pytest.mark.parametrize("seed", range(5))
def test_inverse_dynamics_and_base_wrench_equal_pinocchios(arm: robots.Robot, seed: int) -> None:
    n = len(arm.joints)
    q, qd, qdd = _state(seed, n)
    gravity = np.random.default_rng(100 + seed).standard_normal(3) * 9.81
    torque, wrench = np.empty(n), np.empty(6)
    inverse_dynamics(build_model(arm), q, qd, qdd, gravity, empty_motion(n), torque, wrench)
    expected = PinocchioArm(arm, gravity).inverse_dynamics(q, qd, qdd)
    scale = 1.0 + np.abs(expected[1]).max()
    np.testing.assert_allclose(torque, expected[0], rtol=0, atol=1e-10 * scale)
    np.testing.assert_allclose(wrench, expected[1], rtol=0, atol=1e-10 * scale)


@pytest.mark.parametrize("arm", ARMS, ids=lambda arm: f"{arm.name}-{len(arm.joints)}")
def test_screws_and_momenta_give_generalized_momentum_and_coriolis_torques(arm: robots.Robot) -> None:
    n = len(arm.joints)
    q, qd, _ = _state(7, n)
    motion = empty_motion(n)
    kinematics_and_momenta(build_model(arm), q, qd, np.array([0.0, 0.0, -9.81]), motion)
    oracle = PinocchioArm(arm)
    oracle.model.armature = np.zeros(n)
    mass = pin.crba(oracle.model, oracle.data, q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    coriolis = pin.computeCoriolisMatrix(oracle.model, oracle.data, q, qd)
    momentum = np.einsum("ji,ji->j", motion.screw, motion.momentum[1:])
    np.testing.assert_allclose(momentum, mass @ qd, atol=1e-11)
    carried = np.einsum("ji,ji->j", motion.screw_rate, motion.momentum[1:])
    np.testing.assert_allclose(carried, coriolis.T @ qd, atol=1e-10)
    gravity = -np.einsum("ji,ji->j", motion.screw, motion.gravity[1:])
    expected = pin.computeGeneralizedGravity(oracle.model, oracle.data, q)
    np.testing.assert_allclose(gravity, expected, atol=1e-11)


def test_poses_equal_pinocchios() -> None:
    arm = random_arm(3, 6)
    q, qd, _ = _state(1, 6)
    motion = empty_motion(6)
    kinematics_and_momenta(build_model(arm), q, qd, np.zeros(3), motion)
    oracle = PinocchioArm(arm)
    pin.forwardKinematics(oracle.model, oracle.data, q)
    for j in range(1, 7):
        np.testing.assert_allclose(motion.rotation[j], oracle.data.oMi[j].rotation, atol=1e-13)
        np.testing.assert_allclose(motion.origin[j], oracle.data.oMi[j].translation, atol=1e-13)


def test_screw_rate_is_the_derivative_of_the_screw() -> None:
    arm = random_arm(4, 7)
    q, qd, _ = _state(2, 7)
    model, h = build_model(arm), 1e-6
    before, now, after = empty_motion(7), empty_motion(7), empty_motion(7)
    kinematics_and_momenta(model, q - h * qd, qd, np.zeros(3), before)
    kinematics_and_momenta(model, q, qd, np.zeros(3), now)
    kinematics_and_momenta(model, q + h * qd, qd, np.zeros(3), after)
    np.testing.assert_allclose(now.screw_rate, (after.screw - before.screw) / (2 * h), atol=1e-8)


@pytest.mark.parametrize(
    ("mounting", "down"),
    [
        ("table", (0.0, 0.0, -1.0)),
        ("ceiling", (0.0, 0.0, 1.0)),
        ("wall", (1.0, 0.0, 0.0)),
        ((0.3, 0.0, 0.0), (0.0, -np.sin(0.3), -np.cos(0.3))),
    ],
)
def test_an_arm_at_rest_weighs_on_its_base_along_gravity(
    mounting: str | tuple[float, float, float], down: tuple[float, float, float]
) -> None:
    scene = Scene(robot="ur5e", mounting=mounting)
    torque, wrench, motion = np.empty(6), np.empty(6), empty_motion(6)
    q = np.array([0.1, -1.2, 1.4, -0.4, 0.7, 0.2])
    inverse_dynamics(
        build_model(scene.robot), q, np.zeros(6), np.zeros(6), scene.gravity_base, motion, torque, wrench
    )
    np.testing.assert_allclose(wrench[:3], 9.81 * scene.robot.mass * np.array(down), atol=1e-10)
    np.testing.assert_allclose(torque, PinocchioArm(scene.robot, scene.gravity_base).inverse_dynamics(
        q, np.zeros(6), np.zeros(6))[0], atol=1e-10)  # fmt: skip


@pytest.mark.slow
def test_kernels_run_uncompiled_with_the_same_result() -> None:
    program = """
import numpy as np, robots
from contactsense.kinematics.inverse_dynamics import inverse_dynamics
from contactsense.kinematics.model import build_model, empty_motion
x, down = np.linspace(-1.0, 1.0, 6), np.array([0, 0, -9.81])
torque, wrench = np.empty(6), np.empty(6)
inverse_dynamics(build_model(robots.load('ur5e')), x, x, x, down, empty_motion(6), torque, wrench)
print(*(v.hex() for v in (*torque.tolist(), *wrench.tolist())))
"""

    def run(**more: str) -> np.ndarray:
        done = subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, **more},
            capture_output=True,
            text=True,
            check=True,
        )
        return np.array([float.fromhex(word) for word in done.stdout.split()])

    np.testing.assert_allclose(run(NUMBA_DISABLE_JIT="1"), run(), rtol=1e-12, atol=1e-12)
