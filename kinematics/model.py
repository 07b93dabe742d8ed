"""Arrays of an arm's kinematics and inertia for the kernels, built from a `robots.Robot`."""

from typing import Annotated, NamedTuple

import numpy as np

from contactsense.robots import Robot
from contactsense.robots.jit.declaration import Floats
from contactsense.robots.jit.flat_buffers import zeros


class Model(NamedTuple):
    """Kinematics and inertia of a serial arm with n joints and n + 1 links, link 0 being the fixed base."""

    rotation: Annotated[Floats, "joints, 3, 3"]
    """Orientation of each joint frame in its parent link's frame at q = 0."""
    translation: Annotated[Floats, "joints, 3"]
    """Origin of each joint frame in its parent link's frame [m]."""
    axis: Annotated[Floats, "joints, 3"]
    """Unit axis of each joint in its joint frame."""
    mass: Annotated[Floats, "joints + 1"]
    """Mass of each link [kg]."""
    com: Annotated[Floats, "joints + 1, 3"]
    """Centre of mass of each link, link frame [m]."""
    inertia: Annotated[Floats, "joints + 1, 3, 3"]
    """Inertia tensor of each link about its centre of mass, link axes [kg m^2]."""
    rotor_inertia: Annotated[Floats, "joints"]
    """Inertia of each joint's rotor, reflected to the joint [kg m^2]."""

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.rotor_inertia)


class Motion(NamedTuple):
    """Results of one pass over the arm, filled by the kernels. All in base axes."""

    rotation: Annotated[Floats, "joints + 1, 3, 3"]
    """Orientation of each link, link axes to base axes."""
    origin: Annotated[Floats, "joints + 1, 3"]
    """Origin of each link frame [m]."""
    screw: Annotated[Floats, "joints, 6"]
    """Screw (o x z, z) of each joint, so that screw . (f, m) is the torque about it."""
    screw_rate: Annotated[Floats, "joints, 6"]
    """Time derivative of `screw`."""
    momentum: Annotated[Floats, "joints + 1, 6"]
    """Linear and angular momentum of link j and all links distal to it [kg m/s, kg m^2/s]."""
    gravity: Annotated[Floats, "joints + 1, 6"]
    """Gravity wrench about the base origin on link j and all links distal to it [N, Nm]."""
    twist: Annotated[Floats, "joints + 1, 6"]
    """Scratch: velocity at the base origin and angular velocity of each link."""


def build_model(robot: Robot) -> Model:
    """Arrays of `robot` for the kernels."""
    return Model(
        rotation=np.array([joint.rotation for joint in robot.joints]).reshape(-1, 3, 3),
        translation=np.array([joint.translation for joint in robot.joints]).reshape(-1, 3),
        axis=np.array([joint.axis for joint in robot.joints]).reshape(-1, 3),
        mass=np.array([link.inertia.mass for link in robot.links]),
        com=np.array([link.inertia.com for link in robot.links]),
        inertia=np.array([link.inertia.tensor for link in robot.links]),
        rotor_inertia=np.array([joint.rotor_inertia for joint in robot.joints]),
    )


def empty_motion(joints: int) -> Motion:
    """Arrays for an arm with that many joints; `contactsense.kinematics.momenta.kinematics_and_momenta` fills
    them."""
    return zeros(Motion, joints=joints)
