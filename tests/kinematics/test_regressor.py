"""The regressor against the kernels that it stands beside, and against Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest

from contactsense.kinematics.model import Motion, build_model, empty_motion
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.kinematics.regressor import PARAMETERS, arm_regressor, bodies_of, parameters_of
from contactsense.kinematics.spatial import dot6
from tests.oracles.pinocchio_arm import PinocchioArm
from tests.oracles.random_arm import random_arm

ARM = random_arm(3, 6)
MODEL = build_model(ARM)
GRAVITY = np.array([1.0, -2.0, -9.0])
THETA = np.array([parameters_of(link.inertia) for link in ARM.links])


def _regressors(q: np.ndarray, qd: np.ndarray) -> tuple[Motion, list[np.ndarray]]:
    motion = empty_motion(6)
    kinematics_and_momenta(MODEL, q, qd, GRAVITY, motion)
    shapes = ((6, 7, PARAMETERS),) * 4
    rows = [np.empty(shape) for shape in shapes]
    arm_regressor(MODEL, motion, GRAVITY, 1.0, 1.0, *rows, np.empty(3))
    return motion, rows


@pytest.mark.parametrize("seed", range(4))
def test_momenta_and_drifts_are_the_regressor_times_the_parameters(seed: int) -> None:
    chance = np.random.default_rng(seed)
    motion, rows = _regressors(chance.uniform(-3, 3, 6), chance.uniform(-2, 2, 6))
    momentum, drift, base_momentum, base_drift = (np.einsum("rkc,kc->r", row, THETA) for row in rows)
    for j in range(6):
        assert momentum[j] == pytest.approx(dot6(motion.screw[j], motion.momentum[j + 1]), rel=1e-12)
        known = dot6(motion.screw_rate[j], motion.momentum[j + 1])
        known += dot6(motion.screw[j], motion.gravity[j + 1])
        assert drift[j] == pytest.approx(known, rel=1e-10)
    np.testing.assert_allclose(base_momentum, motion.momentum[0], rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(base_drift, motion.gravity[0], rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("seed", range(4))
def test_its_rate_is_pinocchios_torque_regressor(seed: int) -> None:
    """tau = d(momentum)/dt - drift, column by column; the rate by central differences."""
    chance = np.random.default_rng(seed)
    q, qd, qdd = chance.uniform(-3, 3, 6), chance.uniform(-2, 2, 6), chance.uniform(-3, 3, 6)
    h = 1e-5
    before = _regressors(q - h * qd + 0.5 * h * h * qdd, qd - h * qdd)[1][0]
    after = _regressors(q + h * qd + 0.5 * h * h * qdd, qd + h * qdd)[1][0]
    ours = (after - before) / (2.0 * h) - _regressors(q, qd)[1][1]
    oracle = PinocchioArm(ARM, GRAVITY)
    theirs = pin.computeJointTorqueRegressor(oracle.model, oracle.data, q, qd, qdd)
    np.testing.assert_allclose(ours[:, 1:].reshape(6, -1), theirs, atol=1e-6, rtol=1e-6)
    assert not ours[:, 0].any()  # the base loads no joint


def test_parameters_there_and_back() -> None:
    for link in ARM.links:
        mass, com, tensor = bodies_of(parameters_of(link.inertia)[None])
        assert mass[0] == link.inertia.mass
        np.testing.assert_allclose(com[0], link.inertia.com, atol=1e-14)
        np.testing.assert_allclose(tensor[0], link.inertia.tensor, atol=1e-12)
