"""Linear response of all sensors, in units of their noise, to a contact wrench on an arm at rest; inverse."""

from typing import Any

import numpy as np

from contactsense.kinematics.model import Motion
from contactsense.kinematics.wrench_transform import wrench_transform
from contactsense.residuals.joint_friction import unmodelled_torque_std
from contactsense.scene import Scene
from contactsense.scene_model.constants import Constants
from contactsense.sensors.link_values import as_fields


def sensor_response(scene: Scene, constants: Constants, motion: Motion) -> np.ndarray:
    """Matrix S of each link: a wrench w on that link (base axes, about the base origin) changes the
    residuals, in units of their noise, by S w.

    The rows are those of the scene's sensors: base wrench, joint torques, link sensors (as in
    `contactsense.isolation.link_hypotheses`). The noise is that of one sample; the joint torques' includes
    the errors of model and friction at rest. S^T S is the information about w under that link's hypothesis.

    Args:
        scene: Which sensors there are.
        constants: Of the scene.
        motion: Poses and joint screws.

    Returns:
        Shape (links, rows, 6).
    """
    sensors = constants.sensors
    links, joints = len(sensors.depth), len(motion.screw)
    parts = []
    if scene.base_wrench is not None:
        root = np.linalg.cholesky(sensors.base_information).T
        parts.append(np.broadcast_to(root, (links, 6, 6)))
    if scene.joint_torque is not None:
        proximal = np.arange(joints) < sensors.depth[:, None]
        parts.append(proximal[:, :, None] * (motion.screw / _torque_std(constants)[:, None]))
    for s in range(len(constants.link_sensors.body)):
        sees = np.arange(links) >= sensors.first_link[s]
        parts.append(sees[:, None, None] * _of_link_sensor(constants, motion, s))
    return np.concatenate(parts, axis=1)


def readings_of(scene: Scene, constants: Constants, motion: Motion, residuals: np.ndarray) -> dict[str, Any]:
    """External readings whose residuals, in units of their noise, are given.

    Args:
        scene, constants, motion: As for `sensor_response`.
        residuals: In the order of its rows, shape (N, rows).

    Returns:
        The readings as arguments of `contactsense.Localizer.locate_batch`.
    """
    base_rows = 0 if scene.base_wrench is None else 6
    torque_rows = 0 if scene.joint_torque is None else len(motion.screw)
    rows = base_rows, torque_rows, *(6 for _ in scene.link_sensors)
    base, torque, *links = np.split(residuals, np.cumsum(rows)[:-1], axis=1)
    root = np.linalg.cholesky(constants.sensors.base_information).T
    values = {
        name: np.linalg.solve(_of_link_sensor(constants, motion, s), link.T).T
        for s, (name, link) in enumerate(zip(scene.link_sensors, links, strict=True))
    }
    return {
        "base_wrench": np.linalg.solve(root, base.T).T if base_rows else None,
        # The torque of the actuator is opposed to that of the contact.
        "joint_torque": -_torque_std(constants) * torque if torque_rows else None,
        **as_fields(values),
    }


def _torque_std(constants: Constants) -> np.ndarray:
    """Standard deviation of each joint torque at rest, shape (n,) [Nm]."""
    variance = constants.sensors.torque_variance
    unmodelled = [unmodelled_torque_std(constants.torque_model, j, 0.0) for j in range(len(variance))]
    return np.asarray(np.sqrt(variance + np.square(unmodelled)))


def _of_link_sensor(constants: Constants, motion: Motion, s: int) -> np.ndarray:
    """Readings of link sensor s, in units of their noise, per wrench about the base origin, shape (6, 6)."""
    mounted = constants.link_sensors
    body = mounted.body[s]
    place = motion.origin[body] + motion.rotation[body] @ mounted.origin[s]
    std = np.sqrt(np.repeat(constants.sensors.link_variance[s], 3))
    return np.asarray(wrench_transform(np.eye(3), -place) / std[:, None])


def wrench(force: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Wrench about the base origin of a force at a point, shapes (..., 3) and (..., 3), to (..., 6)."""
    return np.concatenate((force, np.cross(point, force)), axis=-1)
