"""Settings of the sensors: poses, meaning of the signals, noise, and results of calibration."""

import re
from typing import Annotated, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    field_validator,
)

from contactsense.robots import Inertia
from contactsense.robots.attribute_docs import with_attributes
from contactsense.robots.files.file_model import FileModel
from contactsense.robots.inertial_fields import Mass, Tensor
from contactsense.robots.primitives import Vector
from contactsense.robots.rotations import rotation_from_rpy, symmetric
from contactsense.robots.units import in_metres, within_one_turn
from contactsense.sensors.field_checks import in_seconds

JointTorqueSignal = Literal[
    "actual_current_as_torque",
    "actual_current",
    "actual_current_minus_target",
    "external_torque",
    "target_moment",
]
"""The RTDE signal that contains the joint torques:

- `actual_current_as_torque`: motor torque at the joint in Nm, as the controller computes it (from PolyScope
5.23 / 10.11);
- `actual_current`: motor current in A, times `torque_constants`;
- `actual_current_minus_target`: the same minus `target_current`, so that the controller's own model is
subtracted;
- `external_torque`: external torques as estimated by the controller, in Nm, from the output registers listed
in `fields`;
- `target_moment`: the torque computed by the controller's own model in Nm; it does not contain contacts and
is useful for tests only.
"""

COMPONENTS = ("fx", "fy", "fz", "mx", "my", "mz")
"""Names of the values of a force/torque sensor, in their order."""

CURRENTS: tuple[JointTorqueSignal, ...] = ("actual_current", "actual_current_minus_target")
"""Signals in A, which `torque_constants` turn into torques."""

Meaning = Literal["motor", "gravity_free", "external"]
"""What a torque signal contains in addition to the contact:

- `motor`: gravity, inertia, rotors and friction;
- `gravity_free`: inertia, rotors and friction; gravity is already subtracted;
- `external`: none of these; the source of the signal has already subtracted a model.
"""

_MEANINGS: dict[JointTorqueSignal, Meaning] = {
    "actual_current_as_torque": "motor",
    "actual_current": "motor",
    "actual_current_minus_target": "external",
    "external_torque": "external",
    "target_moment": "motor",
}

LEAST_NOISE = 1e-9
"""Smallest standard deviation of a sensor [N or Nm]: covariances with less are singular in double
precision."""
Noise = Annotated[float, Field(ge=LEAST_NOISE, le=1e4)]
"""Standard deviation of a sensor [N or Nm]: no sensor is noisier, and squares of huge numbers overflow."""
_OfJoint = Annotated[float, Field(ge=0.0, le=1e6)]
"""What is known of a joint: even in mNm, no arm's is larger, and squares of huge numbers overflow."""
Number = _OfJoint | tuple[_OfJoint, ...]
"""One value for all joints, or one per joint."""
_TorqueConstant = Annotated[float, Field(gt=0.0, le=1e4)]
_Torque = Annotated[float, Field(ge=-1e6, le=1e6)]
_Velocity = Annotated[float, Field(gt=0.0, le=100.0)]
"""Of a joint [rad/s]: none is faster."""
_Load = Annotated[float, Field(ge=-1e6, le=1e6)]
"""Component of a reading [N or Nm]: no sensor of an arm measures more."""
_Range = Annotated[float, Field(gt=0.0, le=1e7)]


def _two_or_six(numbers: object) -> object:
    if numbers is not None and not (isinstance(numbers, list | tuple) and len(numbers) in (2, 6)):
        got = len(numbers) if isinstance(numbers, list | tuple) else repr(numbers)
        raise ValueError(
            f"expected two numbers, force and moment, or six, one per component [N, Nm], got {got}"
        )
    return numbers


class Part(FileModel):
    """A part of a scene: immutable, no unknown fields, finite numbers."""

    model_config = ConfigDict(use_attribute_docstrings=True)


@with_attributes
class WrenchSensor(Part):
    """A six-axis force/torque sensor: its frame, the sign of its readings, and their noise.

    Live and in recordings, readings are converted with frame, sign and bias. The wrenches of a
    `contactsense.Sample` have been converted, as by `contactsense.scene_model.wrench_map.WrenchMap`.

    Raises:
        FieldError: A field is wrong; the message names it, what was expected and what was given.
    """

    force_noise: Noise = 0.25
    """Standard deviation of each force component of one sample [N]."""
    moment_noise: Noise = 0.05
    """Standard deviation of each moment component of one sample, about the sensor's origin [Nm]."""
    rpy: Annotated[Vector, AfterValidator(within_one_turn)] = (0.0, 0.0, 0.0)
    """Orientation of the sensor's frame in the base frame: roll, pitch, yaw about fixed x, y, z [rad]."""
    translation: Annotated[Vector, AfterValidator(in_metres)] = (0.0, 0.0, 0.0)
    """Origin of the sensor's frame in the base frame [m]."""
    sign: Literal["arm_on_sensor", "sensor_on_arm"] = "arm_on_sensor"
    """Which side's push is counted as positive: with `arm_on_sensor` a table-mounted arm at rest reads a
    force along -z."""
    bias: tuple[_Load, _Load, _Load, _Load, _Load, _Load] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    """Reading of the sensor without load, in its own frame and sign: force, then moment [N, Nm]."""
    delay: Annotated[float, AfterValidator(in_seconds)] = 0.0
    """Delay of the readings relative to the joint positions of the same instant [s]. It is taken off live and
    from recordings; a program that makes samples itself must do the same."""

    range: Annotated[tuple[_Range, ...] | None, BeforeValidator(_two_or_six)] = None
    """Largest force and moment that the sensor measures, in its own frame [N, Nm]: two numbers, or six, one
    per component. While a component is at or beyond it, the sensor is not used. None: unknown."""

    @property
    def limits(self) -> np.ndarray:
        """`range` of each component of a reading, shape (6,) [N, Nm]; infinite where it is unknown."""
        if self.range is None:
            return np.full(6, np.inf)
        return np.repeat(self.range, 6 // len(self.range))

    @property
    def rotation(self) -> np.ndarray:
        """Orientation of the sensor's frame in the base frame, shape (3, 3)."""
        return rotation_from_rpy(self.rpy)

    @property
    def sign_factor(self) -> float:
        """1 where the sensor counts the wrench of the arm on it as positive, -1 where the reaction to it."""
        return 1.0 if self.sign == "arm_on_sensor" else -1.0


@with_attributes
class LinkWrenchSensor(WrenchSensor):
    """A six-axis force/torque sensor between two links of the arm.

    Raises:
        FieldError: A field is wrong; the message names it, what was expected and what was given.
    """

    name: str
    """Name of the sensor: small letters, digits and underscores, a letter first; neither `base` nor `wrist`.
    The readings in a recording are the columns `NAME_wrench_0` to `NAME_wrench_5`."""
    link: str
    """The link at whose proximal end the sensor sits, beyond the joint that moves the link: any of the arm's
    but the first, which `base_wrench` carries. The sensor carries that whole link and everything distal to
    it, tool included, and measures contacts there."""
    rpy: Annotated[Vector, AfterValidator(within_one_turn)] = (0.0, 0.0, 0.0)
    """Orientation of the sensor's frame in the frame of `link`: roll, pitch, yaw about fixed x, y, z
    [rad]."""
    translation: Annotated[Vector, AfterValidator(in_metres)] = (0.0, 0.0, 0.0)
    """Origin of the sensor's frame in the frame of `link` [m]."""
    sign: Literal["arm_on_sensor", "sensor_on_arm"] = "arm_on_sensor"
    """Which side's push is counted as positive: with `arm_on_sensor` the weight of what the sensor carries
    reads as a force along gravity."""

    @field_validator("name")
    @classmethod
    def _is_free(cls, name: str) -> str:
        if re.fullmatch("[a-z][a-z0-9_]*", name) is None:
            raise ValueError(f"expected small letters, digits and underscores, a letter first, got {name!r}")
        if name in ("base", "wrist"):
            raise ValueError(f"expected a name other than base and wrist, got {name!r}")
        return name


@with_attributes
class Friction(Part):
    """Friction of the joints' drives; one value for all joints or one per joint.

    The torque that friction takes from the actuator at joint velocity qd is

        (coulomb + load |gravity torque|) tanh(qd / velocity) + lubricant tanh(qd / lubricant_velocity)
        + viscous qd
    """

    coulomb: Number = 0.0
    """Coulomb friction [Nm]."""
    load: Number = 0.0
    """Coulomb friction per gravity torque that the joint carries."""
    viscous: Number = 0.0
    """Viscous friction [Nm s/rad]."""
    lubricant: Number = 0.0
    """Friction of the lubricant, which increases with the velocity and saturates [Nm]."""
    velocity: _Velocity = 0.01
    """Width of the smooth sign [rad/s]."""
    lubricant_velocity: _Velocity = 0.2
    """Velocity at which the lubricant's friction saturates [rad/s]."""
    error: Number = 0.0
    """Relative standard deviation of friction from this formula between days, mainly due to oil
    temperature. Where it is positive, a stream estimates a factor on the friction of each joint."""
    rest_error: Number = 0.0
    """Standard deviation of friction from this formula at rest and at reversals [Nm]: a joint at rest holds
    any torque up to Coulomb friction."""
    rest_velocity: _Velocity = 0.02
    """Velocity below which `rest_error` applies [rad/s]."""


@with_attributes
class JointTorqueSensor(Part):
    """Joint torques from motor currents: the signal, its meaning, and its noise.

    Raises:
        FieldError: A field is wrong; the message names it, what was expected and what was given.
    """

    signal: JointTorqueSignal = "actual_current_as_torque"
    """The RTDE signal that is read."""
    meaning: Meaning | None = None
    """What the signal contains in addition to the contact; by default, as implied by its name."""
    fields: tuple[Annotated[str, Field(min_length=1)], ...] | None = None
    """RTDE fields, or a recording's columns, that contain the torques, one per joint, such as output
    registers; needed for `external_torque`."""
    sign: Literal["by_actuator", "on_arm"] = "by_actuator"
    """Which torque is counted as positive: the actuator's, or that exerted by the environment on the arm."""
    torque_constants: tuple[_TorqueConstant, ...] | None = None
    """Joint torque per motor current [Nm/A], one per joint; needed for currents if the robot's data have
    none."""
    bias: _Torque | tuple[_Torque, ...] = 0.0
    """Reading without any torque, actuator's sign [Nm]."""
    noise: Noise | tuple[Noise, ...] = 1.0
    """Standard deviation of one sample, one value for all joints or one per joint [Nm]."""
    model_error: Number = 0.0
    """Standard deviation of the error of model and friction, at rest as in motion [Nm]. Unlike noise, it
    does not average out."""
    inertia_torque_error: Number = 0.0
    """Standard deviation of the inertia torque from the model, relative: an error of the torque in proportion
    to the rate of the joint's momentum, in addition to `model_error`. Without effect on signals that contain
    no inertia."""
    average_error: Number = 1.0
    """Standard deviation of these two errors and of friction's `rest_error` in an average of the residuals
    over 80 ms (at 10 Hz), relative to that in a sample: 1 if they last, less if they average out, more if the
    noise is not white."""
    friction: Friction = Friction()
    """Friction of the drives, unless the signal is free of it."""
    rotor_inertia: tuple[_OfJoint, ...] | None = None
    """Inertia of the rotors reflected to the joints [kg m^2], one per joint; by default, the robot's data."""

    @field_validator("fields")
    @classmethod
    def _has_each_once(cls, fields: tuple[str, ...] | None) -> tuple[str, ...] | None:
        for index, name in enumerate(fields or ()):
            if name in (fields or ())[:index]:
                raise ValueError(f"expected another field for each joint, got {name!r} twice")
        return fields

    @property
    def contains(self) -> Meaning:
        """What the signal contains in addition to the contact."""
        return self.meaning or _MEANINGS[self.signal]


class LinkInertia(Part):
    """Mass distribution of one link, if the robot's data are not accurate enough."""

    mass: Mass
    """Mass [kg]."""
    com: Vector
    """Centre of mass, link frame [m]."""
    tensor: Tensor
    """Inertia about the centre of mass, link axes, as ixx, ixy, ixz, iyy, iyz, izz [kg m^2]."""

    @property
    def inertia(self) -> Inertia:
        """The same as `robots.Inertia`."""
        return Inertia(self.mass, np.array(self.com), symmetric(self.tensor))


def per_joint(value: float | tuple[float, ...], joints: int) -> np.ndarray:
    """One value for all joints, or one per joint, as an array of shape (joints,)."""
    return np.broadcast_to(np.asarray(value, dtype=np.float64), (joints,)).copy()
