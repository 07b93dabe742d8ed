"""A setup: what a scene and the reading of its signals state, as numbers that predict the readings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.kinematics.regressor import bodies_of, parameters_of
from contactsense.kinematics.wrench_transform import wrench_transform
from contactsense.robots import Inertia
from contactsense.robots.tool import move_inertia
from contactsense.scene import JointTorqueSensor, Scene, WrenchSensor
from contactsense.scene_model.link_sensors import mounts
from contactsense.sensors.settings import Meaning

Kind = Literal[
    "zero", "tilt", "mass", "com", "load", "place", "turn", "shift", "delay", "lag", "force", "moment",
    "wrench", "gain",
]  # fmt: skip
"""A kind of continuous parameters:

- `zero`: of one joint: what is added to its position as read [rad];
- `tilt`: direction of gravity, about the two base axes that change it most [rad];
- `mass`, `com`: of the tool [kg, m];
- `load`, `place`: mass and centre of mass of a load on a link, link frame [kg, m];
- `turn`, `shift`: of a force/torque sensor: its rotation vector [rad] and displacement [m], in the axes of
  the frame in which the scene gives its pose;
- `delay`: of its readings [s];
- `lag`: delay of the joint torques [s];
- `force`, `moment`, `wrench`: natural logarithm of the scale of its forces, of its moments, of both;
- `gain`: the same of the joint torques, of all or of one joint.
"""
SIZES: dict[Kind, int] = {
    "zero": 1, "tilt": 2, "mass": 1, "com": 3, "load": 1, "place": 3, "turn": 3, "shift": 3, "delay": 1,
    "lag": 1, "force": 1, "moment": 1, "wrench": 1, "gain": 1,
}  # fmt: skip
"""Number of parameters of each kind."""
BASE = "base_wrench"
Order = tuple[int, ...]
"""Which value as read is that of each joint, counted from 1; negative: with the opposite sign."""


class Free(NamedTuple):
    """A group of continuous parameters."""

    kind: Kind
    field: str = ""
    """Field of the scene of the force/torque sensor; empty: the group is of no sensor."""
    joint: int | None = None
    """Index of the joint; None: all joints."""
    link: int | None = None
    """Index of the link that a load is on, the base being 0; None: the group is of no load."""

    @property
    def size(self) -> int:
        """Number of parameters."""
        return SIZES[self.kind]


SCALED: dict[Kind, np.ndarray] = {
    "force": np.repeat([1.0, 0.0], 3),
    "moment": np.repeat([0.0, 1.0], 3),
    "wrench": np.ones(6),
}
"""Which components of a force/torque sensor each kind of scale changes."""


@dataclass(frozen=True)
class SensorSetup:
    """What is assumed about one force/torque sensor; its pose is given in the frame of a link or, that of the
    wrist sensor, of the flange."""

    rotation: np.ndarray
    """Orientation of its frame, shape (3, 3)."""
    translation: np.ndarray
    """Its origin, shape (3,) [m]."""
    sign: float
    """1 if it reads the wrench of what it carries on it, -1 for the reverse."""
    order: np.ndarray
    """Its six values as read, from those in the order and units of the sensor's frame, shape (6, 6): a
    permutation with signs and scales."""
    bias: np.ndarray
    """Its reading without load, as read, shape (6,) [N, Nm]."""
    delay: float
    """Of its readings [s]."""
    body: int
    """Index of the link in which it rests, the base being 0: it carries this link and all beyond."""
    tool_alone: bool
    """Whether it carries nothing but the tool, and its pose is given in the flange's frame."""

    @classmethod
    def of(cls, sensor: WrenchSensor, body: int, tool_alone: bool = False) -> Self:
        """What the scene states."""
        return cls(
            sensor.rotation,
            np.array(sensor.translation),
            sensor.sign_factor,
            np.eye(6),
            np.array(sensor.bias),
            sensor.delay,
            body,
            tool_alone,
        )

    def moved(self, group: Free, step: np.ndarray) -> dict[str, Any]:
        """The fields that a step of one group of parameters changes, with their new values."""
        if group.kind == "turn":
            return {"rotation": Rotation.from_rotvec(step).as_matrix() @ self.rotation}
        if group.kind == "shift":
            return {"translation": self.translation + step}
        if group.kind in SCALED:
            return {"order": self.order * np.exp(SCALED[group.kind] * step[0])}
        return {"delay": self.delay + float(step[0])}

    def without_mirror(self) -> Self | None:
        """The sensor that reads the same where all axes are mirrored, with the opposite sign and another
        rotation in place of that; None: they are not mirrored.

        For the reflection P and the rotation R, P R^T = -(R')^T with R' = -R P^T.
        """
        signs = np.sign(self.order)
        mirror = signs[:3, :3]
        both = block_diag(mirror, mirror)
        if not np.array_equal(signs, both) or np.linalg.det(mirror) > 0.0:
            return None
        order, rotation = both.T @ self.order, -self.rotation @ mirror.T
        return replace(self, sign=-self.sign, rotation=rotation, order=order)


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
    loads: np.ndarray
    """Masses on the links, as points, that the scene does not state, shape (L,) [kg]."""
    places: np.ndarray
    """Where they are, or would be, in each link's frame, shape (L, 3) [m]."""
    sensors: Mapping[str, SensorSetup]
    """The force/torque sensors by field of the scene, the base sensor first."""
    gain: np.ndarray
    """Joint torques as read per torque of the actuator, shape (n,); 0: the value read is a constant."""
    meaning: Meaning
    """What the joint torque signal contains."""
    angle_order: Order
    """Of the joint positions and velocities."""
    angle_zero: tuple[float, ...]
    """What is added to each joint position, in the arm's order [rad]."""
    torque_order: Order
    """Of the joint torques."""
    torque_delay: float
    """By how much they come later than the joint positions [s]."""

    @classmethod
    def of(cls, scene: Scene) -> Self:
        """What the scene states."""
        torque = scene.joint_torque or JointTorqueSensor()
        tool = scene.tool_inertia
        links = CalibrationModel.of(scene).links
        return cls(
            robot=scene.robot.name,
            angle_unit=1.0,
            links=links,
            flange=(scene.robot.flange_rotation, scene.robot.flange_translation),
            gravity=scene.gravity_base,
            mass=tool.mass,
            com=np.asarray(tool.com, dtype=float),
            tensor=tool.tensor,
            loads=np.zeros(len(links)),
            places=bodies_of(links)[1],
            sensors=_sensors(scene),
            gain=np.ones(len(scene.robot.joints)),
            meaning=torque.contains,
            angle_order=plain_order(len(scene.robot.joints)),
            torque_order=plain_order(len(scene.robot.joints)),
            angle_zero=(0.0,) * len(scene.robot.joints),
            torque_delay=0.0,
        )

    def with_robot(self, scene: Scene) -> Self:
        """The same cell with the arm of another scene."""
        other = Setup.of(scene)
        places = np.where(self.loads[:, None] > 0.0, self.places, other.places)
        return replace(self, robot=other.robot, links=other.links, flange=other.flange, places=places)

    def moved(self, free: tuple[Free, ...], step: np.ndarray) -> Self:
        """A copy with these groups changed by their parts of `step`, in order; a mass stays positive."""
        changed, first = self, 0
        for group in free:
            part = step[first : first + group.size]
            first += group.size
            if group.kind == "zero":
                zero = np.array(changed.angle_zero)
                zero[slice(None) if group.joint is None else group.joint] += part[0]
                changed = replace(changed, angle_zero=tuple(zero.tolist()))
            elif group.kind == "tilt":
                turn = Rotation.from_rotvec(part @ horizontal(changed.gravity))
                changed = replace(changed, gravity=turn.apply(changed.gravity))
            elif group.kind == "mass":
                changed = replace(changed, mass=max(0.0, changed.mass + float(part[0])))
            elif group.kind == "com":
                changed = replace(changed, com=changed.com + part)
            elif group.kind == "load":
                loads = changed.loads.copy()
                loads[group.link] = max(0.0, loads[group.link] + part[0])
                changed = replace(changed, loads=loads)
            elif group.kind == "place":
                places = changed.places.copy()
                places[group.link] += part
                changed = replace(changed, places=places)
            elif group.kind == "lag":
                changed = replace(changed, torque_delay=changed.torque_delay + float(part[0]))
            elif group.kind == "gain":
                scaled = changed.gain.copy()
                scaled[slice(None) if group.joint is None else group.joint] *= np.exp(part[0])
                changed = replace(changed, gain=scaled)
            else:
                changed = changed.with_sensor(group.field, **changed.sensors[group.field].moved(group, part))
        return changed

    @cached_property
    def loaded_links(self) -> np.ndarray:
        """Inertial parameters of the links with their loads, without the tool, shape (L, 10)."""
        rows = self.links.copy()
        for link in np.flatnonzero(self.loads):
            rows[link] += parameters_of(Inertia(self.loads[link], self.places[link], np.zeros((3, 3))))
        return rows

    @cached_property
    def bodies(self) -> np.ndarray:
        """The same with the tool in the last link, shape (L, 10)."""
        rows = self.loaded_links.copy()
        rows[-1] += parameters_of(move_inertia(Inertia(self.mass, self.com, self.tensor), *self.flange))
        return rows

    def carried(self, field: str) -> np.ndarray:
        """Inertial parameters of the K bodies of `contactsense.setup_check.terms.load_terms` as far as a
        sensor carries them, shape (K, 10)."""
        sensor = self.sensors[field]
        return (self.bodies - self.loaded_links if sensor.tool_alone else self.bodies)[sensor.body :]

    def reading_per_wrench(self, field: str) -> np.ndarray:
        """Values of a sensor as read per wrench on it, axes and origin of the link in which it rests, shape
        (6, 6)."""
        sensor = self.sensors[field]
        rotation, place = sensor.rotation, sensor.translation
        if sensor.tool_alone:
            rotation, place = self.flange[0] @ rotation, self.flange[0] @ place + self.flange[1]
        back = rotation.T
        return np.asarray(sensor.sign * sensor.order @ wrench_transform(back, -back @ place))

    def per_unit(self, fields: Sequence[str]) -> np.ndarray:
        """Size of 1 Nm or 1 N in the values as read, shape (C,): of the joint torques, then of six values of
        each of the force/torque sensors in `fields`. 1 for a torque that is read as a constant."""
        torques = np.where(self.gain == 0.0, 1.0, np.abs(self.gain))
        return np.concatenate([torques, *(np.abs(self.sensors[field].order).sum(axis=1) for field in fields)])

    def with_sensor(self, field: str, **changes: Any) -> Self:
        """A copy in which one sensor differs."""
        changed = replace(self.sensors[field], **changes)
        return replace(self, sensors={**self.sensors, field: changed})


def _sensors(scene: Scene) -> dict[str, SensorSetup]:
    """What the scene states of its force/torque sensors."""
    found = {} if scene.base_wrench is None else {BASE: SensorSetup.of(scene.base_wrench, 0)}
    for field, mount in mounts(scene).items():
        found[field] = SensorSetup.of(mount.settings, mount.body, mount.first_body > mount.body)
    return found


def plain_order(joints: int) -> Order:
    """The values as read are in the arm's order."""
    return tuple(range(1, joints + 1))


def in_order(values: np.ndarray, order: Order) -> np.ndarray:
    """Values of the joints, shape (..., n), from those as read, of the same shape."""
    places = np.array(order)
    return np.asarray(values[..., np.abs(places) - 1] * np.sign(places))


def horizontal(gravity: np.ndarray) -> np.ndarray:
    """Two unit vectors normal to gravity and to each other, shape (2, 3)."""
    down = gravity / np.linalg.norm(gravity)
    axis = np.eye(3)[np.argmin(np.abs(down))]
    first = np.cross(down, axis)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(down, first)])
