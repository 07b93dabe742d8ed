"""Friction beyond the scene's, from residuals without contact."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from contactsense import Localizer, SampleBlock, Scene
from contactsense.sensors.settings import Friction, JointTorqueSensor
from contactsense.service.analysis.residuals.friction_residuals import FrictionChange, FrictionResiduals
from contactsense.service.mock.arm.script import Move, Noise, Script, Trajectory
from contactsense.service.mock.arm.simulated_arm import Motion, simulate

COULOMB, VISCOUS = np.array([4.0, 4.0, 3.0, 1.5, 1.5, 1.5]), np.array([5.0, 5.0, 4.0, 2.0, 2.0, 2.0])
BIAS = np.array([0.5, -0.4, 0.3, 0.2, -0.2, 0.1])


@cache
def _motion() -> Motion:
    """Thirty seconds in which all joints but the last move to and fro."""
    chance = np.random.default_rng(5)
    home = np.array([0.0, -1.3, 1.6, -1.9, -1.57, 0.0])
    amplitude = np.array([0.7, 0.6, 0.6, 0.7, 0.7, 0.0])
    moves = [Move(to=tuple(home + chance.uniform(-1.0, 1.0, 6) * amplitude), duration=2.0) for _ in range(14)]
    trajectory = Trajectory(start=tuple(home), dwell=2.0, moves=tuple(moves))
    noise = Noise(base_force=0.25, base_moment=0.05, joint_torque=1.0, seed=4)
    return simulate(Script(robot="ur5e", noise=noise, trajectory=trajectory))


def _fit(factor: float, cuts: tuple[int, ...] = ()) -> FrictionChange:
    """The fit where friction is `factor` times what the scene says."""
    motion = _motion()
    friction = COULOMB * np.tanh(motion.qd / 0.01) + VISCOUS * motion.qd
    torque = motion.joint_torque + factor * friction + BIAS
    sensor = JointTorqueSensor(
        model_error=0.5, friction=Friction(coulomb=tuple(COULOMB), viscous=tuple(VISCOUS), error=0.3)
    )
    scene = Scene(robot="ur5e", joint_torque=sensor)
    residuals = FrictionResiduals(scene)
    block = SampleBlock(motion.t, motion.q, motion.qd, torque, motion.base_wrench)
    edges = (0, *cuts, len(block))
    parts = [block[a:b] for a, b in pairwise(edges)]
    done = iter([part for whole in parts for part in whole.split(8192)])
    for found in Localizer(scene).run_blocks(parts):
        residuals.add(next(done), found)
    return residuals.fit()


@pytest.mark.parametrize("factor", [0.9, 1.0, 1.15])
def test_injected_friction_is_found_joint_by_joint(factor: float) -> None:
    found = _fit(factor)
    moving = slice(0, 5)
    for value, std, truth in (
        (found.coulomb, found.coulomb_std, (factor - 1.0) * COULOMB),
        (found.viscous, found.viscous_std, (factor - 1.0) * VISCOUS),
    ):
        assert np.all(std[moving] > 0.0)
        np.testing.assert_array_less(np.abs(value - truth)[moving], 4.0 * std[moving])
    # Coulomb friction is known to a tenth of a newton metre.
    assert np.all(found.coulomb_std[moving] < 0.1)
    np.testing.assert_allclose(found.bias[moving], BIAS[moving], atol=0.1)
    assert np.isnan(found.coulomb[5])
    assert np.isnan(found.viscous_std[5])
    assert repr(found).startswith("<friction beyond the scene's: Coulomb [")


def test_blocks_may_be_cut_anywhere() -> None:
    whole = _fit(1.15)
    cut = _fit(1.15, (1, 617, 618, 5000))
    np.testing.assert_array_equal(cut.coulomb, whole.coulomb)
    np.testing.assert_array_equal(cut.viscous, whole.viscous)


def test_nothing_taken_in_is_nothing_known() -> None:
    found = FrictionResiduals(Scene(robot="ur5e")).fit()
    assert np.isnan(found.coulomb).all()
    assert found.viscous.shape == (6,)
