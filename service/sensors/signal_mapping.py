"""Conversion of sensor readings to the quantities of `contactsense.Sample`, determined by the scene's
settings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from contactsense.runtime.constants import wrench_transform
from contactsense.scene import Scene, WrenchSensor
from contactsense.service.sensors.robot_stream import SensorError

_CURRENTS = ("actual_current", "actual_current_minus_target")


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
        if sensor.signal in _CURRENTS:
            scale *= torque_constants(scene)
        fields = sensor.fields or (sensor.signal,)
        if sensor.signal == "actual_current_minus_target":
            return cls(sensor.fields or ("actual_current",), ("target_current",), scale)
        return cls(fields, (), scale)

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


@dataclass(frozen=True, slots=True)
class WrenchMap:
    """From a sensor's own frame and sign to the wrench of the arm on it, base origin and axes, and back."""

    to_base: np.ndarray
    """Base wrench = `to_base` @ sensor wrench, shape (6, 6)."""
    to_sensor: np.ndarray
    """Its inverse, shape (6, 6)."""
    bias: np.ndarray
    """The sensor's reading without load, shape (6,) [N, Nm]."""

    def wrench(self, reading: np.ndarray) -> np.ndarray:
        """Wrench of the arm on the sensor, base axes and origin, from readings of shape (..., 6) [N, Nm]."""
        return np.asarray((reading - self.bias) @ self.to_base.T)

    def reading(self, wrench: np.ndarray) -> np.ndarray:
        """The sensor's reading under a wrench of shape (..., 6) [N, Nm]; the inverse of `wrench`."""
        return np.asarray(wrench @ self.to_sensor.T + self.bias)

    @classmethod
    def make(
        cls,
        rotation: np.ndarray,
        translation: np.ndarray,
        sign: float = 1.0,
        bias: Sequence[float] = (0.0,) * 6,
    ) -> "WrenchMap":
        """The map for a sensor with a given mounting.

        Args:
            rotation: Orientation of the sensor's frame in the base frame, shape (3, 3).
            translation: Origin of the sensor's frame in the base frame [m], shape (3,).
            sign: As `contactsense.sensors.settings.WrenchSensor.sign_factor`.
            bias: Its reading without load [N, Nm], 6 values.
        """
        to_base = sign * wrench_transform(rotation, np.asarray(translation, dtype=float))
        return cls(to_base, np.linalg.inv(to_base), np.array(bias, dtype=float))

    @classmethod
    def of(cls, sensor: WrenchSensor) -> "WrenchMap":
        """The map for a scene's sensor under the base."""
        return cls.make(sensor.rotation, np.asarray(sensor.translation), sensor.sign_factor, sensor.bias)
