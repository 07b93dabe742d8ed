"""The simulated arm's physics against Pinocchio."""

import numpy as np
import pytest

from contactsense.service.mock.arm.newton_euler import LinkLoad, inverse_dynamics
from tests.oracles.pinocchio_arm import PinocchioArm
from tests.oracles.random_arm import random_arm


@pytest.mark.parametrize(("seed", "joints"), [(1, 6), (2, 6), (3, 7), (4, 1), (5, 2)])
def test_equals_pinocchio(seed: int, joints: int) -> None:
    arm, chance, samples = random_arm(seed, joints), np.random.default_rng(seed + 100), 20
    gravity = tuple(chance.uniform(-10.0, 10.0, 3))
    q, qd, qdd = chance.uniform(-3.0, 3.0, (3, samples, joints))
    loads = [LinkLoad(link, *chance.uniform(-50.0, 50.0, (2, samples, 3))) for link in range(joints + 1)]

    torque, wrench = inverse_dynamics(arm, q, qd, qdd, loads, gravity)
    oracle = PinocchioArm(arm, gravity)
    for i in range(samples):
        touching = [(load.link, load.force[i], load.moment[i]) for load in loads]
        expected_torque, expected_wrench = oracle.inverse_dynamics(q[i], qd[i], qdd[i], touching)
        np.testing.assert_allclose(torque[i], expected_torque, rtol=0, atol=1e-9)
        np.testing.assert_allclose(wrench[i], expected_wrench, rtol=0, atol=1e-9)


def test_a_resting_arm_weighs_on_its_sensor() -> None:
    arm = random_arm(6, 6)
    still = np.zeros((1, 6))
    _, wrench = inverse_dynamics(arm, still + 0.3, still, still)
    np.testing.assert_allclose(wrench[0, :3], [0.0, 0.0, -9.81 * arm.mass], atol=1e-9)
