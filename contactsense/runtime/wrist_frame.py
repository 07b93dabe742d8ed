"""The frame of the wrist sensor, which moves with the flange."""

import numpy as np

from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.robots import Robot
from contactsense.runtime.constants import tool_in_last_link, wrench_transform
from contactsense.scene import Scene
from contactsense.sensors.settings import WrenchSensor


class WristFrame:
    """From the frame of a wrist sensor, given in the flange's, to base axes and back."""

    def __init__(self, sensor: WrenchSensor, robot: Robot) -> None:
        """Create the map for one sensor on one arm."""
        self._model, self._motion = build_model(robot), empty_motion(len(robot.joints))
        self._rotation = robot.flange_rotation @ sensor.rotation
        self._origin = robot.flange_rotation @ np.array(sensor.translation) + robot.flange_translation
        self._sign = 1.0 if sensor.sign == "arm_on_sensor" else -1.0
        self._bias = np.array(sensor.bias)

    def wrench(self, q: np.ndarray, reading: np.ndarray) -> np.ndarray:
        """Wrench of everything beyond the sensor on it, base axes and origin, shape (..., 6) [N, Nm].

        Args:
            q: Joint positions, shape (n,) [rad].
            reading: In the sensor's own frame and sign, shape (..., 6) [N, Nm].
        """
        return np.asarray(self._sign * (reading - self._bias) @ self._to_base(q).T)

    def reading(self, q: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """The sensor's reading under a wrench; the inverse of `wrench`."""
        return np.asarray(self._sign * wrench @ np.linalg.inv(self._to_base(q)).T + self._bias)

    def _to_base(self, q: np.ndarray) -> np.ndarray:
        forward_kinematics(self._model, q, self._motion)
        R, o = self._motion.rotation[-1], self._motion.origin[-1]
        return wrench_transform(R @ self._rotation, o + R @ self._origin)


class ToolWeight:
    """Weight of what the wrist sensor of one scene carries."""

    def __init__(self, scene: Scene) -> None:
        """Take tool and gravity from `scene`."""
        tool = tool_in_last_link(scene)
        self._com, self._force = tool.com, tool.mass * scene.gravity_base
        self._model, self._motion = build_model(scene.robot), empty_motion(len(scene.robot.joints))

    def wrench(self, q: np.ndarray) -> np.ndarray:
        """Wrench of the tool at rest on the sensor, base axes, base origin, shape (6,) [N, Nm].

        Args:
            q: Joint positions, shape (n,) [rad].
        """
        forward_kinematics(self._model, q, self._motion)
        place = self._motion.origin[-1] + self._motion.rotation[-1] @ self._com
        return np.concatenate((self._force, np.cross(place, self._force)))
