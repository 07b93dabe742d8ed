"""The reading that a force/torque sensor within the arm must have at rest: the weight of what it carries."""

import numpy as np

from contactsense.robots.link_poses import link_poses
from contactsense.scene import Scene
from contactsense.scene_model.arm_model import model_with_tool
from contactsense.scene_model.link_sensor_frame import LinkSensorFrame
from contactsense.scene_model.link_sensors import mounts


def link_reading_at_rest(scene: Scene, field: str, q: np.ndarray) -> np.ndarray:
    """Reading of a sensor within the arm while nothing moves or touches.

    Args:
        scene: The scene.
        field: The sensor's key in `Scene.link_sensors`.
        q: Joint positions, shape (n,) [rad].

    Returns:
        In the sensor's own frame and sign, shape (6,) [N, Nm].
    """
    mount, model = mounts(scene)[field], model_with_tool(scene)
    # Whole links beyond the sensor, or the part of the last link that a wrist sensor carries: the tool.
    bodies = range(mount.first_body, len(scene.robot.links))
    masses = np.array([*(model.mass[i] for i in bodies), mount.load.mass])
    centres = np.array([*(model.com[i] for i in bodies), mount.load.com])
    poses = link_poses(scene.robot, q)[[*bodies, mount.body]]
    centres = np.einsum("lij,lj->li", poses[:, :3, :3], centres) + poses[:, :3, 3]
    weight = np.concatenate(
        (masses.sum() * scene.gravity_base, np.cross(masses @ centres, scene.gravity_base))
    )
    return LinkSensorFrame(scene, field).reading(q, weight)
