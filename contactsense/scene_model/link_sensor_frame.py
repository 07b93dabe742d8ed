"""The frame of a link sensor, which moves with the arm."""

import numpy as np

from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import Model, Motion, build_model, empty_motion
from contactsense.kinematics.wrench_transform import wrench_transform
from contactsense.scene import Scene
from contactsense.scene_model.link_sensors import mounts


class LinkSensorFrame:
    """From the frame of one of `Scene.link_sensors` to base axes and back."""

    def __init__(self, scene: Scene, field: str) -> None:
        """Create the map for one sensor.

        Args:
            scene: Arm and sensors.
            field: Key of the sensor in `Scene.link_sensors`, such as `wrist_wrench`.

        Raises:
            ValueError: The scene has no such sensor.
        """
        known = mounts(scene)
        if field not in known:
            raise ValueError(
                f"{field}: expected a sensor of the scene, which has {', '.join(known) or 'none'}"
            )
        self._model, self._motion = build_model(scene.robot), empty_motion(len(scene.robot.joints))
        self._mount = known[field]
        self._sign = self._mount.settings.sign_factor
        self._bias = np.array(self._mount.settings.bias)
        load_kinematics(self._model, self._motion)

    def wrench(self, q: np.ndarray, reading: np.ndarray) -> np.ndarray:
        """Wrench of everything beyond the sensor on it, base axes and origin, shape (..., 6) [N, Nm].

        Args:
            q: Joint positions, shape (n,) [rad].
            reading: In the sensor's own frame and sign, shape (..., 6) [N, Nm].

        Raises:
            ValueError: `q` has not one number per joint.
        """
        return np.asarray(self._sign * (reading - self._bias) @ self._to_base(q).T)

    def reading(self, q: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """The sensor's reading under a wrench, shape (..., 6) [N, Nm]; the inverse of `wrench`."""
        return np.asarray(self._sign * wrench @ np.linalg.inv(self._to_base(q)).T + self._bias)

    def wrenches(self, q: np.ndarray, readings: np.ndarray) -> np.ndarray:
        """`wrench` of N readings, shape (N, 6), each in its posture, shape (N, n)."""
        found = [self.wrench(*row) for row in zip(q, readings, strict=True)]
        return np.array(found, dtype=np.float64).reshape(-1, 6)

    def readings(self, q: np.ndarray, wrenches: np.ndarray) -> np.ndarray:
        """`reading` of N wrenches, shape (N, 6), each in its posture, shape (N, n)."""
        found = [self.reading(*row) for row in zip(q, wrenches, strict=True)]
        return np.array(found, dtype=np.float64).reshape(-1, 6)

    def _to_base(self, q: np.ndarray) -> np.ndarray:
        q = np.asarray(q, dtype=np.float64)  # another type would be compiled anew, for seconds
        if q.shape != (self._model.joints,):
            raise ValueError(
                f"q: expected {self._model.joints} joint positions, got an array of shape {q.shape}"
            )
        forward_kinematics(self._model, q, self._motion)
        R, o = self._motion.rotation[self._mount.body], self._motion.origin[self._mount.body]
        return wrench_transform(R @ self._mount.rotation, o + R @ self._mount.origin)


def load_kinematics(model: Model, motion: Motion) -> None:
    """Load the machine code of the kinematics now: that takes tenths of a second, which no sample of a stream
    and no request to the service should wait for."""
    forward_kinematics(model, np.zeros(model.joints), motion)
