"""Settings of the sensors: where they are, what their signals mean, how noisy they are, what calibration
found out about them."""

from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, NonNegativeFloat, PositiveFloat
from scipy.spatial.transform import Rotation

from contactsense.robots import Inertia
from contactsense.robots.primitives import Vector

JointTorqueSignal = Literal[
    "actual_current_as_torque",
    "actual_current",
    "actual_current_minus_target",
    "external_torque",
    "target_moment",
]
"""Which RTDE signal carries the joint torques:

- `actual_current_as_torque`: motor torque at the joint in Nm, as the controller computes it (from PolyScope
5.23 / 10.11);
- `actual_current`: motor current in A, times `torque_constants`;
- `actual_current_minus_target`: the same less `target_current`, so that the controller's own model is taken
off;
- `external_torque`: external torques as the controller sees them, in Nm, from the output registers that
`fields` names;
- `target_moment`: what the controller's own model asks for in Nm; it feels no contact and is of use for
trials only.
"""

Meaning = Literal["motor", "gravity_free", "external"]
"""What a torque signal contains beside the contact:

- `motor`: gravity, inertia, rotors and friction;
- `gravity_free`: inertia, rotors and friction, gravity having been taken off;
- `external`: nothing of the three, a model having been taken off by whoever made the signal.
"""

_MEANINGS: dict[JointTorqueSignal, Meaning] = {
    "actual_current_as_torque": "motor",
    "actual_current": "motor",
    "actual_current_minus_target": "external",
    "external_torque": "external",
    "target_moment": "motor",
}

Number = NonNegativeFloat | tuple[NonNegativeFloat, ...]
"""One number for all joints, or one each."""
Six = tuple[float, float, float, float, float, float]


class Part(BaseModel):
    """A part of a scene: immutable, no unknown fields, finite numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class WrenchSensor(Part):
    """A six-axis force/torque sensor: where its frame is, which way its readings count, how noisy they
    are."""

    force_noise: PositiveFloat = 0.25
    """Standard deviation of each force component of one sample [N]."""
    moment_noise: PositiveFloat = 0.05
    """Standard deviation of each moment component of one sample, about the sensor's origin [Nm]."""
    rpy: Vector = (0.0, 0.0, 0.0)
    """Orientation of the sensor's frame in the base frame: roll, pitch, yaw about fixed x, y, z [rad]."""
    translation: Vector = (0.0, 0.0, 0.0)
    """Origin of the sensor's frame in the base frame [m]."""
    sign: Literal["arm_on_sensor", "sensor_on_arm"] = "arm_on_sensor"
    """Whose push is counted positive: with `arm_on_sensor` a table-mounted arm at rest reads a force along
    -z."""
    bias: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    """What the sensor reads without any load, in its own frame and sign: force, then moment [N, Nm]."""
    delay: float = 0.0
    """By how much readings come later than the joint positions of the same instant [s]."""

    @property
    def rotation(self) -> np.ndarray:
        """Orientation of the sensor's frame in the base frame, shape (3, 3)."""
        return np.asarray(Rotation.from_euler("xyz", self.rpy).as_matrix())


class Friction(Part):
    """Friction of the joints' drives; numbers for all joints or one each.

    The torque that friction takes from the actuator at joint velocity qd is

        (coulomb + load |gravity torque|) tanh(qd / velocity) + lubricant tanh(qd / lubricant_velocity)
        + viscous qd
    """

    coulomb: Number = 0.0
    """Coulomb friction [Nm]."""
    load: Number = 0.0
    """Coulomb friction per gravity torque that the joint carries."""
    viscous: Number = 0.0
    """Viscous friction [Nms/rad]."""
    lubricant: Number = 0.0
    """Friction of the lubricant, which rises with the velocity and levels off [Nm]."""
    velocity: PositiveFloat = 0.01
    """Width of the smooth sign [rad/s]."""
    lubricant_velocity: PositiveFloat = 0.2
    """Velocity at which the lubricant's friction levels off [rad/s]."""
    error: Number = 0.0
    """How far friction is from this formula on another day: relative, standard deviation. Oil gets warm."""
    rest_error: Number = 0.0
    """How far friction at rest and at reversals is from this formula, standard deviation [Nm]: a joint at
    rest holds any torque up to Coulomb friction."""
    rest_velocity: PositiveFloat = 0.02
    """Velocity below which `rest_error` counts [rad/s]."""


class JointTorqueSensor(Part):
    """Joint torques from motor currents: which signal, what it means, how noisy it is."""

    signal: JointTorqueSignal = "actual_current_as_torque"
    """The RTDE signal that is read."""
    meaning: Meaning | None = None
    """What the signal contains beside the contact; without it, what its name says."""
    fields: tuple[str, ...] | None = None
    """RTDE fields, or a recording's columns, that carry the torques, one per joint, such as output registers;
    needed for `external_torque`."""
    sign: Literal["by_actuator", "on_arm"] = "by_actuator"
    """Whose torque is counted positive: the actuator's, or that which the surroundings put on the arm."""
    torque_constants: tuple[PositiveFloat, ...] | None = None
    """Joint torque per motor current [Nm/A], one per joint; needed for currents where the robot's data have
    none."""
    bias: float | tuple[float, ...] = 0.0
    """What is read without any torque, actuator's sign [Nm]."""
    noise: PositiveFloat | tuple[PositiveFloat, ...] = 1.0
    """Standard deviation of one sample, one number for all joints or one each [Nm]."""
    model_error: Number = 0.0
    """What model and friction leave unexplained while the arm moves, standard deviation [Nm]. Unlike noise it
    does not average out."""
    friction: Friction = Friction()
    """Friction of the drives, unless the signal is free of it."""
    rotor_inertia: tuple[NonNegativeFloat, ...] | None = None
    """Inertia of the rotors as seen at the joints [kg m^2], one per joint; without it, the robot's data."""

    @property
    def contains(self) -> Meaning:
        """What the signal contains beside the contact."""
        return self.meaning or _MEANINGS[self.signal]


class LinkInertia(Part):
    """Mass distribution of one link, where the robot's data are not good enough."""

    mass: NonNegativeFloat
    """Mass [kg]."""
    com: Vector
    """Centre of mass, link frame [m]."""
    tensor: Six
    """Inertia about the centre of mass, link axes, as ixx, ixy, ixz, iyy, iyz, izz [kg m^2]."""

    @property
    def inertia(self) -> Inertia:
        """The same as `robots.Inertia`."""
        xx, xy, xz, yy, yz, zz = self.tensor
        return Inertia(self.mass, np.array(self.com), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))


def per_joint(value: float | tuple[float, ...], joints: int) -> np.ndarray:
    """One number for all joints, or one each, as an array of shape (joints,)."""
    return np.broadcast_to(np.asarray(value, dtype=np.float64), (joints,)).copy()
