"""A setup: what a scene and the reading of its signals state, as numbers that predict the readings."""

from dataclasses import dataclass, replace
from typing import Any, Literal, Self

import numpy as np
from scipy.spatial.transform import Rotation

from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.kinematics.regressor import parameters_of
from contactsense.robots import Inertia
from contactsense.robots.tool import move_inertia
from contactsense.runtime.constants import wrench_transform
from contactsense.scene import JointTorqueSensor, Scene, WrenchSensor
from contactsense.sensors.settings import Meaning

Free = Literal["tilt", "turn", "shift", "delay", "mass", "com", "wrist_turn", "wrist_shift"]
"""A group of continuous parameters:

- `tilt`: direction of gravity, about the two base axes that change it most [rad];
- `turn`, `shift`: rotation vector of the base sensor in base axes [rad], and its displacement [m];
- `delay`: of the base sensor's readings [s];
- `mass`, `com`: of the tool [kg, m];
- `wrist_turn`, `wrist_shift`: of the wrist sensor, as those of the base sensor, in flange axes [rad, m].
"""
SIZES: dict[Free, int] = {
    "tilt": 2, "turn": 3, "shift": 3, "delay": 1, "mass": 1, "com": 3, "wrist_turn": 3, "wrist_shift": 3,
}  # fmt: skip
"""Number of parameters of each group."""
Place = Literal["base", "wrist"]
"""Where a force/torque sensor is."""


@dataclass(frozen=True)
class SensorSetup:
    """What is assumed about one force/torque sensor; its pose is given in the base or flange frame."""

    rotation: np.ndarray
    """Orientation of its frame, shape (3, 3)."""
    translation: np.ndarray
    """Its origin, shape (3,) [m]."""
    sign: float
    """1 if it reads the wrench of what it carries on it, -1 for the reverse."""
    order: np.ndarray
    """Its six values as read, from those in the order of the sensor's frame, shape (6, 6)."""
    bias: np.ndarray
    """Its reading without load, as read, shape (6,) [N, Nm]."""

    @classmethod
    def of(cls, sensor: WrenchSensor) -> Self:
        """What the scene states."""
        return cls(
            sensor.rotation,
            np.array(sensor.translation),
            1.0 if sensor.sign == "arm_on_sensor" else -1.0,
            np.eye(6),
            np.array(sensor.bias),
        )

    def turned(self, step: np.ndarray) -> Self:
        """A copy turned by a rotation vector, shape (3,) [rad]."""
        return replace(self, rotation=Rotation.from_rotvec(step).as_matrix() @ self.rotation)

    def shifted(self, step: np.ndarray) -> Self:
        """A copy displaced by `step`, shape (3,) [m]."""
        return replace(self, translation=self.translation + step)

    @property
    def reading_per_wrench(self) -> np.ndarray:
        """Values as read per wrench on the sensor, axes and origin of the frame of its pose, shape (6, 6)."""
        return self.sign * self.order @ np.linalg.inv(wrench_transform(self.rotation, self.translation))


@dataclass(frozen=True)
class Setup:
    """What is assumed about arm, mounting, tool and signals. n joints, L links."""

    robot: str
    """Name of the arm."""
    angle_unit: float
    """Radians per unit of the joint positions as read."""
    links: np.ndarray
    """Inertial parameters of the links without the tool, shape (L, 10)."""
    flange: tuple[np.ndarray, np.ndarray]
    """Orientation and origin of the flange in the last link's frame."""
    gravity: np.ndarray
    """In base axes, shape (3,) [m/s^2]."""
    mass: float
    """Of the tool [kg]."""
    com: np.ndarray
    """Of the tool, flange frame, shape (3,) [m]."""
    tensor: np.ndarray
    """Inertia of the tool about its centre of mass, flange axes, shape (3, 3) [kg m^2]."""
    base: SensorSetup
    """The base sensor."""
    wrist: SensorSetup
    """The wrist sensor."""
    delay: float
    """Of the base sensor's readings [s]."""
    gain: np.ndarray
    """Joint torques as read per torque of the actuator, shape (n,)."""
    meaning: Meaning
    """What the joint torque signal contains."""

    @classmethod
    def of(cls, scene: Scene) -> Self:
        """What the scene states."""
        base, torque = scene.base_wrench or WrenchSensor(), scene.joint_torque or JointTorqueSensor()
        tool = scene.tool.inertia if scene.tool is not None else Inertia(0.0, np.zeros(3), np.zeros((3, 3)))
        return cls(
            robot=scene.robot.name,
            angle_unit=1.0,
            links=CalibrationModel.of(scene).links,
            flange=(scene.robot.flange_rotation, scene.robot.flange_translation),
            gravity=scene.gravity_base,
            mass=tool.mass,
            com=np.asarray(tool.com, dtype=float),
            tensor=tool.tensor,
            base=SensorSetup.of(base),
            wrist=SensorSetup.of(scene.wrist_wrench or WrenchSensor()),
            delay=base.delay,
            gain=np.ones(len(scene.robot.joints)),
            meaning=torque.contains,
        )

    def with_robot(self, scene: Scene) -> Self:
        """The same cell with the arm of another scene."""
        other = Setup.of(scene)
        return replace(self, robot=other.robot, links=other.links, flange=other.flange)

    def moved(self, free: tuple[Free, ...], step: np.ndarray) -> Self:
        """A copy with these groups changed by their parts of `step`, in order; a mass stays positive."""
        changed, first = self, 0
        for name in free:
            part = step[first : first + SIZES[name]]
            first += SIZES[name]
            if name == "tilt":
                turn = Rotation.from_rotvec(part @ horizontal(changed.gravity))
                changed = replace(changed, gravity=turn.apply(changed.gravity))
            elif name == "turn":
                changed = replace(changed, base=changed.base.turned(part))
            elif name == "shift":
                changed = replace(changed, base=changed.base.shifted(part))
            elif name == "wrist_turn":
                changed = replace(changed, wrist=changed.wrist.turned(part))
            elif name == "wrist_shift":
                changed = replace(changed, wrist=changed.wrist.shifted(part))
            elif name == "delay":
                changed = replace(changed, delay=changed.delay + float(part[0]))
            elif name == "mass":
                changed = replace(changed, mass=max(0.0, changed.mass + float(part[0])))
            else:
                changed = replace(changed, com=changed.com + part)
        return changed

    @property
    def bodies(self) -> np.ndarray:
        """Inertial parameters of the links, the tool in the last one, shape (L, 10)."""
        rows = self.links.copy()
        rows[-1] += parameters_of(move_inertia(Inertia(self.mass, self.com, self.tensor), *self.flange))
        return rows

    @property
    def tool(self) -> np.ndarray:
        """Inertial parameters of the tool, flange frame, shape (10,)."""
        return parameters_of(Inertia(self.mass, self.com, self.tensor))

    def sensor(self, place: Place) -> SensorSetup:
        """One of the two force/torque sensors."""
        return self.base if place == "base" else self.wrist

    def with_sensor(self, place: Place, **changes: Any) -> Self:
        """A copy in which one sensor differs."""
        changed = replace(self.sensor(place), **changes)
        return replace(self, base=changed) if place == "base" else replace(self, wrist=changed)


def horizontal(gravity: np.ndarray) -> np.ndarray:
    """Two unit vectors normal to gravity and to each other, shape (2, 3)."""
    down = gravity / np.linalg.norm(gravity)
    axis = np.eye(3)[np.argmin(np.abs(down))]
    first = np.cross(down, axis)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(down, first)])
