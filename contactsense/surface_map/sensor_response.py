"""Linear response of all sensors to a contact wrench, in units of their noise, for an arm at rest."""

import numpy as np

from contactsense.kinematics.model import Motion
from contactsense.kinematics.wrench_transform import wrench_transform
from contactsense.residuals.joint_friction import unmodelled_torque_std
from contactsense.scene import Scene
from contactsense.scene_model.constants import Constants


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
        unmodelled = [unmodelled_torque_std(constants.torque_model, j, 0.0) for j in range(joints)]
        std = np.sqrt(sensors.torque_variance + np.square(unmodelled))
        proximal = np.arange(joints) < sensors.depth[:, None]
        parts.append(proximal[:, :, None] * (motion.screw / std[:, None]))
    mounted = constants.link_sensors
    for s, body in enumerate(mounted.body):
        place = motion.origin[body] + motion.rotation[body] @ mounted.origin[s]
        about_sensor = wrench_transform(np.eye(3), -place)
        std = np.sqrt(np.repeat(sensors.link_variance[s], 3))
        sees = np.arange(links) >= sensors.first_link[s]
        parts.append(sees[:, None, None] * (about_sensor / std[:, None]))
    return np.concatenate(parts, axis=1)


def wrench(force: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Wrench about the base origin of a force at a point, shapes (..., 3) and (..., 3), to (..., 6)."""
    return np.concatenate((force, np.cross(point, force)), axis=-1)
