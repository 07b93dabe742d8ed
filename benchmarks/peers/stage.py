"""Common input of all peers: the arm of a scene, its surface, and the effect of a contact on the sensors.

Measurements are whitened: each row is divided by its standard deviation, so that a squared residual is a sum
of squares. Rows are first the joint torques, then the six of the base wrench; the rows of an absent sensor
are zero.
"""

from typing import NamedTuple

import numpy as np

from contactsense import Scene
from contactsense.kinematics.model import Model, Motion, empty_motion
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.robots.vectors import Vector
from contactsense.scene_model.constants import build_constants


class Noise(NamedTuple):
    """Whitening of a measurement to rows with unit noise."""

    torque: np.ndarray
    """Inverse standard deviation of each joint torque, shape (n,) [1/Nm]; zeros without torques."""
    base: np.ndarray
    """Square root of the base wrench's information, shape (6, 6); zeros without a base sensor."""


class Stage(NamedTuple):
    """One arm in the form that the peers' kernels use."""

    model: Model
    motion: Motion
    """Scratch: poses of the links at the sample's joint positions."""
    surfaces: Surfaces
    ball: np.ndarray
    """Ball about each link's surface in its frame: centre and radius, shape (links, 4) [m]."""
    noise: Noise
    friction: float
    """Coefficient of friction."""


def build_stage(scene: Scene, least_torque: float = 0.0, least_moment: float = 0.0) -> Stage:
    """Arrays of a scene.

    Args:
        scene: Defines the sensors and their noise.
        least_torque: Minimum noise assumed for joint torques [Nm]: a filter with few particles needs a
            likelihood that is wide enough for them.
        least_moment: The same for the base moment [Nm]; the base force is widened by the same factor.
    """
    arm = build_constants(scene)
    joints = arm.model.joints
    torque = np.zeros(joints)
    if scene.joint_torque is not None:
        torque = 1.0 / np.maximum(np.sqrt(arm.sensors.torque_variance), least_torque)
    base: np.ndarray = np.zeros((6, 6))
    if scene.base_wrench is not None:
        base = np.linalg.cholesky(arm.sensors.base_information).T.copy()
        base *= min(1.0, scene.base_wrench.moment_noise / max(least_moment, 1e-12))
    return Stage(
        arm.model,
        empty_motion(joints),
        arm.surfaces,
        _balls(arm.surfaces),
        Noise(torque, base),
        float(scene.friction),
    )


def _balls(surfaces: Surfaces) -> np.ndarray:
    balls = np.zeros((len(surfaces.start) - 1, 4))
    for link in range(len(balls)):
        own = slice(surfaces.start[link], surfaces.start[link + 1])
        if surfaces.start[link] < surfaces.start[link + 1]:
            origin, radius = surfaces.origin[own], surfaces.radius[own]
            centre = ((origin - radius[:, None]).min(axis=0) + (origin + radius[:, None]).max(axis=0)) / 2.0
            balls[link] = *centre, (np.linalg.norm(origin - centre, axis=1) + radius).max()
    return balls


def given(
    q: np.ndarray, base_wrench: np.ndarray | None, joint_torque: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Measurements as arguments of the kernels: joint positions, base wrenches, joint torques, one sample per
    row.

    A sensor that is absent reads zero; its rows have no weight.

    Raises:
        ValueError: neither sensor is given.
    """
    n = len(q)
    if base_wrench is None and joint_torque is None:
        raise ValueError("base_wrench, joint_torque: expected at least one of the two, got none")
    base = np.zeros((n, 6)) if base_wrench is None else base_wrench
    torque = np.zeros(np.shape(q)) if joint_torque is None else joint_torque
    q, base, torque = (np.ascontiguousarray(array, dtype=np.float64) for array in (q, base, torque))
    return q, base, torque


@kernel
def measure(noise: Noise, joint_torque: np.ndarray, base_wrench: np.ndarray, rows: np.ndarray) -> None:
    """Fill `rows` (n + 6,) with a measurement in units of its noise.

    Args:
        noise: Noise of the sensors.
        joint_torque: External part of the actuators' torques, shape (n,): a contact wrench w leaves -s_j . w.
        base_wrench: External wrench on the base sensor, shape (6,).
        rows: Filled.
    """
    n = joint_torque.shape[0]
    for j in range(n):
        rows[j] = -joint_torque[j] * noise.torque[j]
    for i in range(6):
        total = 0.0
        for k in range(6):
            total += noise.base[i, k] * base_wrench[k]
        rows[n + i] = total


@kernel
def load(noise: Noise, motion: Motion, link: int, x: float, y: float, z: float, rows: np.ndarray) -> None:
    """Effect of a force at a given place on the sensors, in units of their noise.

    Joint j measures the force f at c as f . (z_j x (c - o_j)) if it is proximal to the link; the base sensor
    measures (f, c x f).

    Args:
        noise, motion: Sensors, and poses of the links.
        link: Number of the touched link.
        x, y, z: Place of the force, base frame [m].
        rows: Filled, shape (n + 6, 3): measurement by force.
    """
    n = motion.screw.shape[0]
    for j in range(n):
        weight = noise.torque[j] if j < link else 0.0
        zx, zy, zz = motion.screw[j, 3], motion.screw[j, 4], motion.screw[j, 5]
        ox, oy, oz = motion.origin[j + 1, 0], motion.origin[j + 1, 1], motion.origin[j + 1, 2]
        dx, dy, dz = x - ox, y - oy, z - oz
        rows[j, 0] = weight * (zy * dz - zz * dy)
        rows[j, 1] = weight * (zz * dx - zx * dz)
        rows[j, 2] = weight * (zx * dy - zy * dx)
    for i in range(6):
        b = noise.base[i]
        # Derivative of (f, c x f) with respect to f.
        rows[n + i, 0] = b[0] + b[4] * z - b[5] * y
        rows[n + i, 1] = b[1] - b[3] * z + b[5] * x
        rows[n + i, 2] = b[2] + b[3] * y - b[4] * x


@kernel
def to_base(motion: Motion, link: int, x: float, y: float, z: float) -> Vector:
    """Transform a point from a link's frame to the base frame, as 3 floats [m]."""
    R, o = motion.rotation[link], motion.origin[link]
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z + o[0],
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z + o[1],
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z + o[2],
    )


@kernel
def to_link(motion: Motion, link: int, x: float, y: float, z: float) -> Vector:
    """Transform a point from the base frame to a link's frame, as 3 floats [m]."""
    R, o = motion.rotation[link], motion.origin[link]
    dx, dy, dz = x - o[0], y - o[1], z - o[2]
    return (
        R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz,
        R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz,
        R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz,
    )


@kernel
def turned_to_base(motion: Motion, link: int, x: float, y: float, z: float) -> Vector:
    """Transform a direction from a link's frame to base axes, as 3 floats."""
    R = motion.rotation[link]
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
    )


@kernel
def turned_to_link(motion: Motion, link: int, x: float, y: float, z: float) -> Vector:
    """Transform a direction from base axes to a link's frame, as 3 floats."""
    R = motion.rotation[link]
    return (
        R[0, 0] * x + R[1, 0] * y + R[2, 0] * z,
        R[0, 1] * x + R[1, 1] * y + R[2, 1] * z,
        R[0, 2] * x + R[1, 2] * y + R[2, 2] * z,
    )
