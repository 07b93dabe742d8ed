"""The places of sensors are found in recordings made by independent dynamics, whatever their noise."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import Scene, WrenchSensor
from contactsense.benchmarks.calibration.simulate import simulate
from contactsense.calibration import Settings, calibrate
from contactsense.calibration.motion.fourier_trajectory import FourierTrajectory
from contactsense.calibration.parameters import Group
from contactsense.robots.tool import Tool
from tests.plain_arm import plain_ur5e

pytestmark = pytest.mark.slow

CENTRE = np.array([0.0, -1.3, 1.5, -1.0, 0.8, 0.0])


def errors(
    truth: Scene,
    searched: Scene,
    groups: tuple[Group, ...],
    shift: dict[str, float],
    velocity_noise: float = 0.0,
) -> np.ndarray:
    """Errors of displacements in four recordings, in their stated standard deviations, shape (4, axes)."""
    found = []
    for seed in range(4):
        motion = FourierTrajectory.draw(np.random.default_rng(seed), CENTRE, np.full(6, 0.6), 6, 15.0)
        exact = simulate(truth, motion, seed, 125.0)
        noise = velocity_noise * np.random.default_rng(seed).standard_normal(exact.qd.shape)
        values = calibrate(searched, [replace(exact, qd=exact.qd + noise)], Settings(groups)).values
        named = {value.entry.name: value for value in values}
        found.append([(named[name].after - true) / named[name].std for name, true in shift.items()])
    return np.array(found)


def test_the_noise_of_the_forces_does_not_draw_a_base_sensor_to_the_base_origin() -> None:
    """It did, by three of the stated standard deviations in the mean: moments about the origin have the less
    noise the shorter the lever."""
    sensor = WrenchSensor(
        force_noise=0.5, moment_noise=0.05, translation=(0.1, -0.05, -0.4), bias=(5, -3, 2, 0.3, 0.1, -0.2)
    )
    scene = Scene(robot=plain_ur5e(), joint_torque=None, base_wrench=sensor)
    found = errors(scene, scene, ("wrench_bias", "shift"), {"shift z": 0.0})
    assert np.abs(found.mean()) < 2.0


def test_the_noise_of_the_velocities_does_not_move_a_base_sensor() -> None:
    """Levers of the force by the model would, by five of the stated standard deviations: it has that noise,
    as the residual has."""
    stated = WrenchSensor(translation=(0.0, 0.0, -0.035))
    scene = Scene(robot=plain_ur5e(), joint_torque=None, base_wrench=stated)
    moved = stated.model_copy(update={"translation": (0.03, 0.0, -0.035)})
    truth = scene.model_copy(update={"base_wrench": moved})
    shift = {"shift x": 0.03, "shift y": 0.0, "shift z": 0.0}
    found = errors(truth, scene, ("wrench_bias", "shift"), shift, velocity_noise=0.001)
    assert np.abs(found.mean(axis=0)).max() < 2.0


def test_the_noise_of_the_velocities_does_not_hide_the_delay_of_a_base_sensor() -> None:
    """It is in the derivatives by the delay, too: the stated delay was confirmed to microseconds."""
    stated = WrenchSensor(translation=(0.0, 0.0, -0.035))
    scene = Scene(robot=plain_ur5e(), joint_torque=None, base_wrench=stated)
    late = scene.model_copy(update={"base_wrench": stated.model_copy(update={"delay": 0.008})})
    known = {"delay of the base sensor": 0.008}
    found = errors(late, scene, ("wrench_bias", "delay"), known, velocity_noise=0.001)
    assert np.abs(found.mean()) < 2.0


def test_the_noise_of_the_velocities_does_not_make_masses_smaller() -> None:
    """It is in their derivatives, too, and did so by two of the stated standard deviations, on average, and
    with them it moved the base sensor up or down."""
    stated = WrenchSensor(translation=(0.0, 0.0, -0.035))
    scene = Scene(robot=plain_ur5e(), joint_torque=None, base_wrench=stated, tool=Tool(mass=1.0))
    groups: tuple[Group, ...] = ("payload", "wrench_bias", "shift")
    found = errors(scene, scene, groups, {"payload mass": 1.0, "shift z": 0.0}, velocity_noise=0.001)
    assert np.abs(found.mean(axis=0)).max() < 1.5


def test_the_noise_of_the_forces_does_not_keep_a_wrist_sensor_near_the_stated_place() -> None:
    """It did, by a third of the displacement with the noise of a flange sensor's data sheet."""
    stated = WrenchSensor(force_noise=5.5, moment_noise=0.5, translation=(0.0, 0.0, 0.02))
    scene = Scene(robot=plain_ur5e(), tool=Tool(mass=1.2, com=(0.01, 0.02, 0.06)), wrist_wrench=stated)
    moved = stated.model_copy(update={"translation": (0.03, -0.04, 0.05)})
    truth = scene.model_copy(update={"wrist_wrench": moved})
    shift = {"wrist_wrench shift x": 0.03, "wrist_wrench shift y": -0.04, "wrist_wrench shift z": 0.03}
    found = errors(truth, scene, ("link_bias", "link_shift"), shift)
    assert np.abs(found.mean(axis=0)).max() < 2.0
