"""Arrays of an arm's kinematics and inertia for the kernels, built from a `robots.Robot`."""

from typing import NamedTuple

import numpy as np

from contactsense.robots import Robot


class Model(NamedTuple):
    """Kinematics and inertia of a serial arm with n joints and n + 1 links, link 0 being the fixed base."""

    rotation: np.ndarray
    """Orientation of each joint frame in its parent link's frame at q = 0, shape (n, 3, 3)."""
    translation: np.ndarray
    """Origin of each joint frame in its parent link's frame [m], shape (n, 3)."""
    axis: np.ndarray
    """Unit axis of each joint in its joint frame, shape (n, 3)."""
    mass: np.ndarray
    """Mass of each link [kg], shape (n + 1,)."""
    com: np.ndarray
    """Centre of mass of each link, link frame [m], shape (n + 1, 3)."""
    inertia: np.ndarray
    """Inertia tensor of each link about its centre of mass, link axes [kg m^2], shape (n + 1, 3, 3)."""
    rotor_inertia: np.ndarray
    """Inertia of each joint's rotor, reflected to the joint [kg m^2], shape (n,)."""

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.rotor_inertia)


class Motion(NamedTuple):
    """Results of one pass over the arm, filled by the kernels. All in base axes."""

    rotation: np.ndarray
    """Orientation of each link, link axes to base axes, shape (n + 1, 3, 3)."""
    origin: np.ndarray
    """Origin of each link frame [m], shape (n + 1, 3)."""
    screw: np.ndarray
    """Screw (o x z, z) of each joint, so that screw . (f, m) is the torque about it, shape (n, 6)."""
    screw_rate: np.ndarray
    """Time derivative of `screw`, shape (n, 6)."""
    momentum: np.ndarray
    """Linear and angular momentum of link j and all links distal to it, shape (n + 1, 6) [kg m/s, kg m^2/s].
    """
    gravity: np.ndarray
    """Gravity wrench about the base origin on link j and all links distal to it, shape (n + 1, 6) [N, Nm]."""
    twist: np.ndarray
    """Scratch: velocity at the base origin and angular velocity of each link, shape (n + 1, 6)."""


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
    links = joints + 1
    return Motion(
        rotation=np.empty((links, 3, 3)),
        origin=np.empty((links, 3)),
        screw=np.empty((joints, 6)),
        screw_rate=np.empty((joints, 6)),
        momentum=np.empty((links, 6)),
        gravity=np.empty((links, 6)),
        twist=np.empty((links, 6)),
    )
