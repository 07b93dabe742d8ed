"""Expected uncertainty of a calibration, computed before the motion is made.

The regressor depends on the motion alone, as nearly all parameters enter linearly. So the information matrix
and the standard deviations follow without any measurement.
"""

from dataclasses import dataclass

import numpy as np

from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.fit.identifiability import excited_directions
from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.motion.fourier_trajectory import FourierTrajectory
from contactsense.calibration.parameters import Entry, Group, entries
from contactsense.calibration.residuals.equations import channels, linearize_all
from contactsense.calibration.residuals.link_residuals import link_readings
from contactsense.calibration.residuals.recording_residuals import friction
from contactsense.kinematics.inverse_dynamics import inverse_dynamics
from contactsense.kinematics.model import empty_motion
from contactsense.residuals.momentum_observer import noise_variance_ratio
from contactsense.scene import Scene
from contactsense.scene_model.wrench_map import WrenchMap
from contactsense.sensors.settings import per_joint


@dataclass(frozen=True)
class ExpectedUncertainty:
    """Expected result of a calibration. k parameters."""

    entries: tuple[Entry, ...]
    std: np.ndarray
    """Standard deviation of each estimate due to the sensors' noise, shape (k,); NaN for parameters that are
    kept."""
    excited: np.ndarray
    """Which parameters the motion excites, shape (k,), bool; the others keep the scene's values."""
    condition: float
    """Condition number of their scaled regressor."""
    information_gain: float
    """Half the log determinant of the scaled information matrix (D-optimality)."""


def expected_uncertainty(
    scene: Scene, groups: tuple[Group, ...], motion: FourierTrajectory, rate: float
) -> ExpectedUncertainty:
    """Expected uncertainty of a calibration of these groups from a motion.

    Args:
        scene: Arm, sensors and their noise.
        groups: Groups of parameters to estimate.
        motion: The motion.
        rate: Sample rate [Hz].
    """
    arm = CalibrationModel.of(scene)
    selected = entries(arm, groups)
    recording = simulated_free_motion(scene, motion, rate)
    size = np.array([entry.prior_std for entry in selected])
    information = np.zeros((len(selected), len(selected)))
    variance = _variance(scene, motion.center.size, rate)
    for row in linearize_all(arm, recording, selected, scene.bandwidth):
        # The observer's noise is an Ornstein-Uhlenbeck process: neighbouring rows are correlated.
        correlation = np.exp(-2.0 * np.pi * scene.bandwidth * row.dt)
        weight = row.moving * (1.0 - correlation) / (1.0 + correlation) / variance[row.channel]
        information[np.ix_(row.columns, row.columns)] += row.slope.T @ (row.slope * weight[:, None])
    excited, condition = excited_directions(information, selected, np.ones(len(selected), dtype=bool))
    scaled = information * np.outer(size, size) + np.eye(len(selected))
    std = np.full(len(selected), np.nan)
    std[excited] = size[excited] * np.sqrt(np.diag(np.linalg.inv(scaled[np.ix_(excited, excited)])))
    return ExpectedUncertainty(selected, std, excited, condition, 0.5 * float(np.linalg.slogdet(scaled)[1]))


def simulated_free_motion(scene: Scene, motion: FourierTrajectory, rate: float) -> FreeMotion:
    """Readings of the scene's sensors during a motion, without noise."""
    arm = CalibrationModel.of(scene)
    t = np.arange(0.0, motion.period, 1.0 / rate)
    q, qd, qdd = motion.at(t)
    torque, wrench, motion_state = np.empty(q.shape), np.empty((len(t), 6)), empty_motion(q.shape[1])
    model, gravity = arm.model, arm.gravity
    for i in range(len(t)):
        inverse_dynamics(model, q[i], qd[i], qdd[i], gravity, motion_state, torque[i], wrench[i])
    if scene.joint_torque is None or scene.joint_torque.contains == "external":
        torque[:] = 0.0
    torque += friction(arm, FreeMotion(t, q, qd)) + arm.bias
    reading = None
    if scene.base_wrench is not None:
        reading = WrenchMap.of(scene.base_wrench).reading(wrench)
    return FreeMotion(
        t,
        q,
        qd,
        torque if scene.joint_torque is not None else None,
        reading,
        "proposed motion",
        link_readings={field: link_readings(arm, field, q, qd, qdd) for field in scene.link_sensors},
    )


def _variance(scene: Scene, joints: int, rate: float) -> np.ndarray:
    """Variance of the filtered noise of each of C equations, shape (C,)."""
    found = np.full(channels(scene), np.inf)
    if scene.joint_torque is not None:
        found[:joints] = per_joint(scene.joint_torque.noise, joints) ** 2
    if scene.base_wrench is not None:
        own = scene.base_wrench
        found[joints : joints + 6] = np.repeat([own.force_noise**2, own.moment_noise**2], 3)
    for number, own in enumerate(scene.link_sensors.values()):
        first = joints + 6 * (number + 1)
        found[first : first + 6] = np.repeat([own.force_noise**2, own.moment_noise**2], 3)
    return found * noise_variance_ratio(scene.bandwidth, 1.0 / rate)
