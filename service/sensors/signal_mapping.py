"""Conversion of sensor readings to the quantities of `contactsense.Sample`, determined by the scene's
settings."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from contactsense.scene import Scene
from contactsense.sensors.settings import CURRENTS
from contactsense.service.sensors.clients.robot_stream import SensorError


@dataclass(frozen=True, slots=True)
class TorqueMap:
    """Which RTDE fields contain the joint torques, and their conversion to newton metres."""

    fields: tuple[str, ...]
    """One field with one value per joint, or one field per joint."""
    minus: tuple[str, ...]
    """Fields whose values are subtracted, in the same order; may be empty."""
    scale: np.ndarray
    """Newton metres per unit, in the actuator's sign, shape (n,)."""

    @classmethod
    def of(cls, scene: Scene) -> "TorqueMap | None":
        """The map for a scene; None if it uses no joint torques.

        Raises:
            SensorError: Motor currents are used, but the torque constants are unknown.
        """
        sensor = scene.joint_torque
        if sensor is None:
            return None
        sign = 1.0 if sensor.sign == "by_actuator" else -1.0
        scale = sign * np.ones(len(scene.robot.joints))
        if sensor.signal in CURRENTS:
            scale *= torque_constants(scene)
        fields = sensor.fields or (sensor.signal,)
        if sensor.signal == "actual_current_minus_target":
            return cls(sensor.fields or ("actual_current",), ("target_current",), scale)
        return cls(fields, (), scale)

    def is_as(self, other: "TorqueMap") -> bool:
        """Whether both give the same torques."""
        return self.names == other.names and np.array_equal(self.scale, other.scale)

    @property
    def names(self) -> tuple[str, ...]:
        """All fields that are read."""
        return self.fields + self.minus

    def torque(self, values: Mapping[str, np.ndarray]) -> np.ndarray:
        """Joint torques in the actuator's sign, shape (..., n) [Nm].

        Args:
            values: Values of each field of `names`, shape (..., n) or (..., 1).
        """
        read = np.concatenate([values[name] for name in self.fields], axis=-1)
        if self.minus:
            read = read - np.concatenate([values[name] for name in self.minus], axis=-1)
        return np.asarray(read * self.scale)


def torque_constants(scene: Scene) -> np.ndarray:
    """Joint torque per motor current [Nm/A], shape (n,): the scene's if given, otherwise the robot's.

    Raises:
        SensorError: Neither has them.
    """
    sensor, joints = scene.joint_torque, scene.robot.joints
    assert sensor is not None
    known = list(
        sensor.torque_constants or [j.torque_constant for j in joints if j.torque_constant is not None]
    )
    if len(known) != len(joints):
        raise SensorError(
            f"joint_torque.signal {sensor.signal}: expected joint_torque.torque_constants [Nm/A], "
            f"{len(joints)} numbers: the data of {scene.robot.name} have none"
        )
    return np.array(known)
