"""What a calibration from a motion will know, told before the motion is made.

The rows of the calibration depend on the motion alone, as nearly all parameters enter linearly; so its
information and the standard deviations that it will state can be had without any measurement.
"""

from dataclasses import dataclass

import numpy as np

from contactsense.arm import about_base
from contactsense.calibration.calibrate import rows_apart
from contactsense.calibration.harmonics import Harmonics
from contactsense.calibration.identifiable import excited
from contactsense.calibration.linearize import linearize
from contactsense.calibration.parameters import Entry, Group, entries
from contactsense.calibration.plant import Plant
from contactsense.calibration.residuals import friction
from contactsense.calibration.stretch import Stretch
from contactsense.observer import noise_gain
from contactsense.scene import Scene
from contactsense.sensing import per_joint
from kinematics.core import inverse_dynamics
from kinematics.model import empty_motion


@dataclass(frozen=True)
class Expected:
    """What calibration from a motion will know. k parameters."""

    entries: tuple[Entry, ...]
    std: np.ndarray
    """Standard deviation of each estimate, for the sensors' noise alone, shape (k,); NaN for those that are
    kept."""
    seen: np.ndarray
    """Which the motion excites, shape (k,), bool; the others will be kept at the scene's values."""
    condition: float
    """Condition number of the scaled regressor of those."""
    gain: float
    """Logarithm of the factor by which the motion shrinks the volume of what may be (D-optimality)."""


def expect(scene: Scene, groups: tuple[Group, ...], motion: Harmonics, rate: float) -> Expected:
    """What calibration with these groups of parameters will know from a motion.

    Args:
        scene: Arm, sensors and their noise.
        groups: What is to be estimated.
        motion: The motion.
        rate: Samples a second [Hz].
    """
    plant = Plant.of(scene)
    chosen = entries(plant, groups, 0.1)
    stretch = quiet(scene, motion, rate)
    every = rows_apart([stretch], scene.bandwidth)
    size = np.array([entry.plausible for entry in chosen])
    information = np.zeros((len(chosen), len(chosen)))
    variance = _variance(scene, motion.center.size, rate)
    for row in linearize(plant, stretch, chosen, scene.bandwidth, every):
        # The observer's noise is an Ornstein-Uhlenbeck process: neighbouring rows say much the same.
        alike = np.exp(-2.0 * np.pi * scene.bandwidth * row.dt)
        weight = row.moving * (1.0 - alike) / (1.0 + alike) / variance[row.channel]
        information[np.ix_(row.columns, row.columns)] += row.slope.T @ (row.slope * weight[:, None])
    seen, condition = excited(information, chosen, np.ones(len(chosen), dtype=bool))
    scaled = information * np.outer(size, size) + np.eye(len(chosen))
    std = np.full(len(chosen), np.nan)
    std[seen] = size[seen] * np.sqrt(np.diag(np.linalg.inv(scaled[np.ix_(seen, seen)])))
    return Expected(chosen, std, seen, condition, 0.5 * float(np.linalg.slogdet(scaled)[1]))


def quiet(scene: Scene, motion: Harmonics, rate: float) -> Stretch:
    """What the scene's sensors will read over a motion, without noise."""
    plant = Plant.of(scene)
    t = np.arange(0.0, motion.period, 1.0 / rate)
    q, qd, qdd = motion.at(t)
    torque, wrench, arm = np.empty(q.shape), np.empty((len(t), 6)), empty_motion(q.shape[1])
    model, gravity = plant.model, plant.gravity
    for i in range(len(t)):
        inverse_dynamics(model, q[i], qd[i], qdd[i], gravity, arm, torque[i], wrench[i])
    if scene.joint_torque is None or scene.joint_torque.contains == "external":
        torque[:] = 0.0
    torque += friction(plant, Stretch(t, q, qd)) + plant.bias
    reading = None
    if scene.base_wrench is not None:
        sensor = scene.base_wrench
        back = np.linalg.inv(about_base(sensor.rotation, np.array(sensor.translation))).T
        sign = 1.0 if sensor.sign == "arm_on_sensor" else -1.0
        reading = sign * wrench @ back + plant.wrench_bias
    return Stretch(t, q, qd, torque if scene.joint_torque is not None else None, reading, "proposed motion")


def _variance(scene: Scene, joints: int, rate: float) -> np.ndarray:
    """Of every equation's filtered noise, shape (n + 6,), the moments about the base origin."""
    found = np.full(joints + 6, np.inf)
    if scene.joint_torque is not None:
        found[:joints] = per_joint(scene.joint_torque.noise, joints) ** 2
    if scene.base_wrench is not None:
        sensor = scene.base_wrench
        transfer = about_base(np.eye(3), np.array(sensor.translation))
        own = np.repeat([sensor.force_noise**2, sensor.moment_noise**2], 3)
        found[joints:] = np.diag(transfer @ np.diag(own) @ transfer.T)
    return found * noise_gain(scene.bandwidth, 1.0 / rate)
