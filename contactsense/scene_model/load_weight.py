"""The weight that a link sensor carries, in any posture."""

import numpy as np

from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import empty_motion
from contactsense.scene import Scene
from contactsense.scene_model.arm_model import model_with_tool
from contactsense.scene_model.link_sensor_frame import load_kinematics
from contactsense.scene_model.link_sensors import mounts


class LoadWeight:
    """Weight of what a link sensor of one scene carries."""

    def __init__(self, scene: Scene, field: str) -> None:
        """Take masses and gravity from `scene`; `field`: the sensor's key in `Scene.link_sensors`."""
        mount = mounts(scene)[field]
        self._gravity, self._body, self._load = scene.gravity_base, mount.body, mount.load
        self._model, self._motion = model_with_tool(scene), empty_motion(len(scene.robot.joints))
        self._carried = range(mount.first_body, len(scene.robot.links))
        load_kinematics(self._model, self._motion)

    def wrench(self, q: np.ndarray) -> np.ndarray:
        """Wrench of the load at rest on the sensor, base axes, base origin, shape (6,) [N, Nm].

        Args:
            q: Joint positions, shape (n,) [rad].
        """
        forward_kinematics(self._model, q, self._motion)
        R, o = self._motion.rotation, self._motion.origin
        mass = self._load.mass
        moment = mass * (o[self._body] + R[self._body] @ self._load.com)
        for link in self._carried:
            mass = mass + self._model.mass[link]
            moment = moment + self._model.mass[link] * (o[link] + R[link] @ self._model.com[link])
        return np.concatenate((mass * self._gravity, np.cross(moment, self._gravity)))
