"""From what sensors deliver to what `contactsense.Sample` means. Pure functions of a scene's settings."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from contactsense.scene import Scene, WrenchSensor
from service.sensors.streams import SensorError


@dataclass(frozen=True, slots=True)
class TorqueMap:
    """Which RTDE field carries the joint torques, and what one unit of it is in newton metres."""

    field: str
    scale: np.ndarray
    """Newton metres per unit, shape (n,)."""

    @classmethod
    def of(cls, scene: Scene) -> "TorqueMap | None":
        """The scene's choice; None where it uses no joint torques.

        Raises:
            SensorError: Motor currents are named, but nobody knows the torque constants.
        """
        sensor = scene.joint_torque
        if sensor is None:
            return None
        joints = scene.robot.joints
        if sensor.signal != "actual_current":
            return cls(sensor.signal, np.ones(len(joints)))
        known = list(
            sensor.torque_constants or [j.torque_constant for j in joints if j.torque_constant is not None]
        )
        if len(known) != len(joints):
            raise SensorError(
                "joint_torque.signal actual_current: expected joint_torque.torque_constants [Nm/A], "
                f"{len(joints)} numbers: the data of {scene.robot.name} have none"
            )
        return cls(sensor.signal, np.array(known))


@dataclass(frozen=True, slots=True)
class WrenchMap:
    """From a sensor's own frame and sign to the wrench of the arm on it, base origin and axes, and back."""

    to_base: np.ndarray
    """Base wrench = `to_base` @ sensor wrench, shape (6, 6)."""
    to_sensor: np.ndarray
    """Its inverse, shape (6, 6)."""

    @classmethod
    def make(
        cls,
        rotation: np.ndarray,
        translation: np.ndarray,
        sign: Literal["arm_on_sensor", "sensor_on_arm"] = "arm_on_sensor",
    ) -> "WrenchMap":
        """The map of a sensor in its place.

        Args:
            rotation: Orientation of the sensor's frame in the base frame, shape (3, 3).
            translation: Origin of the sensor's frame in the base frame [m], shape (3,).
            sign: Whose push the sensor counts positive.
        """
        x, y, z = np.asarray(translation, dtype=float)
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        zero = np.zeros((3, 3))
        s = 1.0 if sign == "arm_on_sensor" else -1.0
        forth = s * np.block([[rotation, zero], [cross @ rotation, rotation]])
        back = s * np.block([[rotation.T, zero], [-rotation.T @ cross, rotation.T]])
        return cls(forth, back)

    @classmethod
    def of(cls, sensor: WrenchSensor) -> "WrenchMap":
        """The map of a scene's sensor under the base."""
        return cls.make(sensor.rotation, np.asarray(sensor.translation), sensor.sign)
