"""Inverse dynamics of the simulated arm: Newton-Euler, link by link, each body in its own axes.

Plain numpy over whole trajectories, directly from the data of a `Robot`. It shares no code and no frames with
`kinematics` (which uses screws about the base origin), so that a sign error in the estimator cannot cancel
here. Follows Luh, Walker & Paul, "On-line computational scheme for mechanical manipulators", 1980.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contactsense.robots import Robot


class LinkLoad(NamedTuple):
    """A wrench that the environment exerts on one link over time, in the axes of that link."""

    link: int
    """Number of the link (base: 0)."""
    force: np.ndarray
    """Force on the link [N], shape (N, 3)."""
    moment: np.ndarray
    """Moment on the link about the link frame's origin [Nm], shape (N, 3)."""


def joint_rotations(robot: Robot, q: np.ndarray) -> list[np.ndarray]:
    """Orientation of each joint's link relative to its parent link.

    Args:
        robot: The arm.
        q: Joint positions [rad]. Shape (N, n).

    Returns:
        One array of shape (N, 3, 3) per joint, which transforms a vector from the link's axes to its
        parent's.
    """
    rotations = []
    for joint, angle in zip(robot.joints, q.T, strict=True):
        x, y, z = joint.axis
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        sine, versine = np.sin(angle)[:, None, None], (1.0 - np.cos(angle))[:, None, None]
        turn = np.eye(3) + sine * cross + versine * (cross @ cross)  # Rodrigues
        rotations.append(joint.rotation @ turn)
    return rotations


def link_poses(robot: Robot, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Poses of all links.

    Args:
        robot: The arm.
        q: Joint positions [rad]. Shape (N, n).

    Returns:
        Orientations in base axes, shape (n + 1, N, 3, 3); origins in the base frame [m], shape (n + 1, N, 3).
    """
    rotation, origin = np.broadcast_to(np.eye(3), (len(q), 3, 3)), np.zeros((len(q), 3))
    rotations, origins = [rotation], [origin]
    for joint, local in zip(robot.joints, joint_rotations(robot, q), strict=True):
        origin = origin + rotation @ joint.translation
        rotation = rotation @ local
        rotations.append(rotation)
        origins.append(origin)
    return np.array(rotations), np.array(origins)


def inverse_dynamics(
    robot: Robot,
    q: np.ndarray,
    qd: np.ndarray,
    qdd: np.ndarray,
    loads: Sequence[LinkLoad] = (),
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
) -> tuple[np.ndarray, np.ndarray]:
    """Ideal readings of joint torque sensors and of a force/torque sensor under the base.

    Args:
        robot: The arm.
        q: Joint positions [rad]. Shape (N, n).
        qd: Joint velocities [rad/s]. Shape (N, n).
        qdd: Joint accelerations [rad/s^2]. Shape (N, n).
        loads: External wrenches on the links.
        gravity: Acceleration of free fall, base axes [m/s^2].

    Returns:
        Torques that the actuators apply, rotor inertia included [Nm], shape (N, n); wrench of the arm on the
        sensor below it, force then moment about the base origin, base axes [N, Nm], shape (N, 6).
    """
    samples, n = q.shape
    rotations = joint_rotations(robot, q)

    omega = np.zeros((samples, 3))
    alpha = np.zeros((samples, 3))
    accel = np.tile(-np.array(gravity), (samples, 1))  # equivalent to gravity
    force, moment = [], []  # total wrench on each body, about its link frame's origin
    for index, link in enumerate(robot.links):
        if index > 0:
            joint, to_parent = robot.joints[index - 1], rotations[index - 1]
            lever = joint.translation
            accel = accel + np.cross(alpha, lever) + np.cross(omega, np.cross(omega, lever))
            to_link = np.swapaxes(to_parent, 1, 2)
            accel = _turn(to_link, accel)
            spin = qd[:, index - 1, None] * joint.axis
            carried = _turn(to_link, omega)
            alpha = _turn(to_link, alpha) + np.cross(carried, spin) + qdd[:, index - 1, None] * joint.axis
            omega = carried + spin
        com, tensor = link.inertia.com, link.inertia.tensor
        accel_com = accel + np.cross(alpha, com) + np.cross(omega, np.cross(omega, com))
        push = link.inertia.mass * accel_com
        force.append(push)
        moment.append(alpha @ tensor.T + np.cross(omega, omega @ tensor.T) + np.cross(com, push))

    for load in loads:
        force[load.link] = force[load.link] - load.force
        moment[load.link] = moment[load.link] - load.moment

    torque = np.empty((samples, n))
    for index in range(n, 0, -1):
        joint, to_parent = robot.joints[index - 1], rotations[index - 1]
        torque[:, index - 1] = moment[index] @ joint.axis + joint.rotor_inertia * qdd[:, index - 1]
        passed = _turn(to_parent, force[index])
        force[index - 1] = force[index - 1] + passed
        couple = _turn(to_parent, moment[index]) + np.cross(joint.translation, passed)
        moment[index - 1] = moment[index - 1] + couple
    return torque, -np.hstack([force[0], moment[0]])


def _turn(rotation: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Rotate each vector by its own rotation: (N, 3, 3), (N, 3) -> (N, 3)."""
    turned: np.ndarray = np.einsum("nij,nj->ni", rotation, vector)
    return turned
