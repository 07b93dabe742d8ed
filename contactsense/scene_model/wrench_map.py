"""From the readings of a force/torque sensor under the base to the wrench of the arm on it, and back."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contactsense.kinematics.wrench_transform import wrench_transform
from contactsense.sensors.settings import WrenchSensor


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
    def of(cls, sensor: WrenchSensor | None) -> "WrenchMap":
        """The map for a scene's sensor under the base, `Scene.base_wrench`.

        Raises:
            ValueError: It is None: the scene has no such sensor.
        """
        if sensor is None:
            raise ValueError("base_wrench: expected a sensor of the scene, which has none under the base")
        return cls.make(sensor.rotation, np.asarray(sensor.translation), sensor.sign_factor, sensor.bias)
