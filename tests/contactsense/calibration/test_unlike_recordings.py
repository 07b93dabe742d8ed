"""Recordings of different sensors and rates in one calibration."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Scene, WrenchSensor
from contactsense.benchmarks.calibration.simulate import simulate
from contactsense.calibration import Calibration, FreeMotion, Settings, calibrate
from contactsense.calibration.motion.fourier_trajectory import FourierTrajectory
from contactsense.robots.tool import Tool
from contactsense.sensors.settings import Friction
from tests.plain_arm import plain_ur5e

pytestmark = pytest.mark.slow  # each fits several times

FRICTION = Friction(
    coulomb=(8.0, 7.0, 4.0, 1.5, 1.2, 1.0), viscous=(10.0, 9.0, 5.0, 2.0, 1.5, 1.0), velocity=0.05
)
TRUTH = Scene(
    robot=plain_ur5e(),
    joint_torque=JointTorqueSensor(friction=FRICTION, rotor_inertia=(3.0, 2.5, 1.5, 0.4, 0.3, 0.3)),
    base_wrench=WrenchSensor(bias=(12.0, -7.0, 20.0, 1.0, -2.0, 0.5), delay=0.004, force_noise=0.5),
    tool=Tool(mass=1.5, com=(0.01, -0.02, 0.06)),
)
SEARCHED = Scene(
    robot=plain_ur5e(),
    joint_torque=JointTorqueSensor(friction=Friction(velocity=0.05)),
    base_wrench=WrenchSensor(),
)


def _recording(seed: int, rate: float) -> FreeMotion:
    rng = np.random.default_rng(seed)
    center = np.array([0.0, -1.3, 1.5, -1.0, 0.8, 0.0])
    motion = FourierTrajectory.draw(rng, center, np.full(6, 0.7), 8, 10.0)
    return simulate(TRUTH, motion, seed, rate)


def _calibrated(*recordings: FreeMotion) -> Calibration:
    groups = ("payload", "bias", "coulomb", "viscous", "rotor", "wrench_bias", "tilt", "turn", "delay")
    return calibrate(SEARCHED, list(recordings), Settings(groups, widths=False))


def _std(found: Calibration) -> dict[str, float]:
    """Standard deviations of what was estimated, by name."""
    return {value.entry.name: value.std for value in found.values if not value.kept}


def test_the_noise_of_a_sensor_is_that_at_its_own_rate() -> None:
    found = _calibrated(_recording(1, 500.0).with_readings({}), _recording(2, 100.0)).scene
    assert found.base_wrench is not None
    assert found.base_wrench.force_noise == pytest.approx(0.5, rel=0.15)


def test_noise_of_recordings_at_different_rates_is_no_model_error() -> None:
    """At a lower rate more of it is in the residuals; those of the slow recording counted as model error, and
    the base sensor's as noise."""
    found = _calibrated(_recording(1, 500.0), _recording(2, 50.0)).scene
    assert found.joint_torque is not None
    assert found.base_wrench is not None
    assert TRUTH.joint_torque is not None
    np.testing.assert_allclose(found.joint_torque.noise, TRUTH.joint_torque.noise, rtol=0.15)
    assert np.max(found.joint_torque.model_error) < 0.3
    assert found.base_wrench.force_noise == pytest.approx(0.5, rel=0.15)


def test_many_samples_of_one_sensor_leave_those_of_two_their_part() -> None:
    """Where a sample of two sensors has twice the energy, none was among the quietest ones, and the friction
    could not be fitted to these."""
    found = _calibrated(replace(_recording(1, 500.0), torque=None), _recording(2, 100.0))
    torque = found.scene.joint_torque
    assert torque is not None
    np.testing.assert_allclose(torque.friction.coulomb, FRICTION.coulomb, atol=0.2)
    assert not found.contacts


def test_a_slow_recording_keeps_its_samples_beside_a_fast_one() -> None:
    """Only one in so many of the fast one's samples was used of both: more data made the base sensor's
    parameters less certain."""
    slow = _recording(2, 40.0)
    alone, both = (
        _std(_calibrated(*parts)) for parts in ([slow], [slow, _recording(1, 500.0).with_readings({})])
    )
    of_base = [name for name in alone if name.startswith(("wrench bias", "turn", "delay"))]
    assert len(of_base) == 10
    for name in of_base:
        assert both[name] < 1.1 * alone[name], name


def test_the_order_of_recordings_at_different_rates_does_not_matter() -> None:
    fast, slow = _recording(1, 500.0), _recording(2, 50.0)
    one, other = _std(_calibrated(fast, slow)), _std(_calibrated(slow, fast))
    assert one.keys() == other.keys()
    np.testing.assert_allclose(list(one.values()), list(other.values()), rtol=1e-6)
