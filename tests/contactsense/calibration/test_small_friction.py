"""Friction that is smaller than its uncertainty, so that some of its coefficients would come out negative."""

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Scene
from contactsense.benchmarks.calibration.simulate import simulate
from contactsense.calibration import Calibration, Settings, calibrate
from contactsense.calibration.motion.fourier_trajectory import FourierTrajectory
from contactsense.sensors.settings import Friction
from tests.plain_arm import plain_ur5e

pytestmark = pytest.mark.slow

TRUE = {"coulomb": 0.02, "viscous": 0.02, "rotor": 0.01, "bias": 0.1}
CENTER = np.array([0.0, -1.3, 1.5, -1.0, 0.8, 0.0])


def _found(coulomb: float) -> Calibration:
    """The calibration of a scene that states this Coulomb friction of every joint [Nm]."""
    small = Friction(coulomb=(TRUE["coulomb"],) * 6, viscous=(TRUE["viscous"],) * 6, velocity=0.05)
    torque = JointTorqueSensor(
        friction=small, rotor_inertia=(TRUE["rotor"],) * 6, bias=(TRUE["bias"],) * 6, noise=(1.0,) * 6
    )
    truth = Scene(robot=plain_ur5e(), joint_torque=torque, base_wrench=None)
    motion = FourierTrajectory.draw(np.random.default_rng(4), CENTER, np.full(6, 0.7), 8, 20.0)
    stated = JointTorqueSensor(friction=Friction(coulomb=(coulomb,) * 6, velocity=0.05))
    scene = Scene(robot=plain_ur5e(), joint_torque=stated, base_wrench=None)
    settings = Settings(("bias", "coulomb", "viscous", "rotor"), widths=False)
    return calibrate(scene, [simulate(truth, motion, 1, 250.0)], settings)


@pytest.fixture(scope="module", params=[0.0, 4.0])
def found(request: pytest.FixtureRequest) -> Calibration:
    return _found(request.param)


def test_what_would_be_negative_is_zero_and_says_how_certain_that_is(found: Calibration) -> None:
    at_zero = [value for value in found.values if value.after == 0.0]
    assert at_zero
    assert all(value.std > 0.0 for value in at_zero)
    assert all(value.after >= 0.0 for value in found.values if value.entry.group != "bias")
    assert sum("came out negative" in warning for warning in found.warnings) == len(at_zero)


def test_every_estimate_is_within_its_uncertainty(found: Calibration) -> None:
    """Also of a scene that states a friction which the drives do not have."""
    for value in found.values:
        assert not value.kept, value.entry.name
        assert abs(value.after - TRUE[value.entry.group]) < 3.5 * value.std, value.entry.name


def test_the_scene_states_it(found: Calibration) -> None:
    assert found.scene.joint_torque is not None
    written = found.scene.joint_torque.friction.coulomb
    expected = [value.after for value in found.values if value.entry.group == "coulomb"]
    assert written == pytest.approx(expected, rel=1e-4)
