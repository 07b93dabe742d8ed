"""The arm's own weight on the sensor below it, in any posture: what a plausible reading is compared with."""

import numpy as np
from scipy.optimize import Bounds, minimize

from contactsense.robots.link_poses import link_poses
from contactsense.runtime.constants import model_with_tool, wrench_transform
from contactsense.scene import Scene
from contactsense.sensors.settings import WrenchSensor

_POSTURES = 300
_LARGEST_ANGLE = np.pi
"""Beyond half a turn to either side the postures repeat [rad]."""


class ArmWeight:
    """Weight of the arm of one scene, its tool included."""

    def __init__(self, scene: Scene) -> None:
        """Take mass distribution and gravity from `scene`."""
        model = model_with_tool(scene)
        self._robot, self._gravity = scene.robot, scene.gravity_base
        self._masses, self._com = model.mass, model.com
        self.mass = float(model.mass.sum())
        """Mass of arm and tool [kg]."""
        self.force = self.mass * self._gravity
        """Its weight, base axes, shape (3,) [N]."""

    def wrench(self, q: np.ndarray) -> np.ndarray:
        """Wrench of the arm at rest on what carries it, base axes, about the base origin, shape (6,) [N, Nm].

        Args:
            q: Joint positions, shape (n,) [rad].
        """
        poses = link_poses(self._robot, q)
        centres = np.einsum("lij,lj->li", poses[:, :3, :3], self._com) + poses[:, :3, 3]
        return np.concatenate((self.force, np.cross(self._masses @ centres, self._gravity)))

    def largest_reading(self, sensor: WrenchSensor) -> np.ndarray:
        """Largest magnitude of each component that a sensor under the base reads of an arm at rest.

        The largest moments of random postures within the joints' limits, each improved to the nearest local
        maximum: the true ones may be slightly larger.

        Args:
            sensor: Pose and bias of the sensor.

        Returns:
            Shape (6,), sensor axes, about its origin [N, Nm].
        """
        chance = np.random.default_rng(0)
        limits = np.array([joint.position_limits for joint in self._robot.joints])
        low, high = np.clip(limits, -_LARGEST_ANGLE, _LARGEST_ANGLE).T
        postures = chance.uniform(low, high, (_POSTURES, len(low)))
        readings = np.array([reading_from_base_wrench(sensor, self.wrench(q)) for q in postures])
        largest = np.abs(readings).max(axis=0)
        for component in (3, 4, 5):  # the force is the same in all postures
            start = int(np.abs(readings[:, component]).argmax())
            sign = float(np.sign(readings[start, component]))

            def opposite(q: np.ndarray, component: int = component, sign: float = sign) -> float:
                return -sign * float(reading_from_base_wrench(sensor, self.wrench(q))[component])

            best = minimize(opposite, postures[start], method="L-BFGS-B", bounds=Bounds(low, high))
            largest[component] = max(largest[component], -best.fun)
        return np.asarray(largest)


def reading_from_base_wrench(sensor: WrenchSensor, wrench: np.ndarray) -> np.ndarray:
    """Readings of the base sensor: the inverse of `contactsense.runtime.constants.base_wrench_from_reading`.

    Args:
        sensor: Pose, sign and bias of the sensor.
        wrench: Wrench of the arm on it, base axes, about the base origin, shape (..., 6) [N, Nm].

    Returns:
        Force and moment as the sensor reports them, shape (..., 6) [N, Nm].
    """
    sign = 1.0 if sensor.sign == "arm_on_sensor" else -1.0
    to_base = wrench_transform(sensor.rotation, np.array(sensor.translation))
    return np.asarray(sign * wrench @ np.linalg.inv(to_base).T + np.array(sensor.bias))
