"""The simulated arm and the obstacles around it as arrays for the kernels."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contactsense.robots import Joint, Link, Robot
from contactsense.robots.rotations import rotation_from_rpy
from contactsense.robots.surface.convex_primitives import Surfaces, pack
from contactsense.robots.tool import Tool
from contactsense.service.mock.arm.obstacles import BoxObstacle, HalfSpace, Obstacle, SphereObstacle

HALF_SPACE, BOX, SPHERE = 0, 1, 2


class Bodies(NamedTuple):
    """A chain of B bodies. Body 0 is fixed; joint j carries body j + 1. The first n joints move, any further
    ones are locked at 0. The tool is a separate body, so that the wrench at the flange is known."""

    rotation: np.ndarray
    """Orientation of each joint frame in the parent body, shape (B - 1, 3, 3)."""
    translation: np.ndarray
    """Origin of each joint frame in the parent body [m], shape (B - 1, 3)."""
    axis: np.ndarray
    """Unit axis of each joint in its own frame, shape (B - 1, 3)."""
    mass: np.ndarray
    """Masses [kg], shape (B,)."""
    com: np.ndarray
    """Centres of mass, body axes [m], shape (B, 3)."""
    inertia: np.ndarray
    """Inertia about the centre of mass, body axes [kg m^2], shape (B, 3, 3)."""
    rotor: np.ndarray
    """Inertia of the rotors, reflected to the joints [kg m^2], shape (n,)."""


class Obstacles(NamedTuple):
    """M obstacles in the base frame."""

    kind: np.ndarray
    """`HALF_SPACE`, `BOX` or `SPHERE`, shape (M,), int64."""
    rotation: np.ndarray
    """Axes as columns, shape (M, 3, 3); the third axis of a half-space is its outward normal."""
    origin: np.ndarray
    """Centre, or a point on the plane [m], shape (M, 3)."""
    half: np.ndarray
    """Half of the edge lengths of a box without its rounding [m], shape (M, 3)."""
    radius: np.ndarray
    """Radius of a sphere, or of a box's edges [m], shape (M,)."""
    stiffness: np.ndarray
    """Normal force per penetration depth [N/m], shape (M,)."""
    damping: np.ndarray
    """Normal force per speed of approach [Ns/m], shape (M,)."""
    friction: np.ndarray
    """Coefficient of friction, shape (M,)."""


def with_tool(robot: Robot, tool: Tool | None) -> Robot:
    """Return the arm with its tool as an additional link on a fixed joint at the flange."""
    if tool is None:
        return robot
    flange = Joint(
        "flange",
        robot.flange_rotation,
        robot.flange_translation,
        np.array([0.0, 0.0, 1.0]),
        (0.0, 0.0),
        0.0,
        0.0,
    )
    carried = Link(tool.name, tool.inertia, tool.primitives)
    return Robot(robot.name, (*robot.links, carried), (*robot.joints, flange))


def bodies(robot: Robot, moving: int) -> Bodies:
    """Arrays of a robot whose first `moving` joints move."""
    return Bodies(
        rotation=np.array([joint.rotation for joint in robot.joints]),
        translation=np.array([joint.translation for joint in robot.joints]),
        axis=np.array([joint.axis for joint in robot.joints]),
        mass=np.array([link.inertia.mass for link in robot.links]),
        com=np.array([link.inertia.com for link in robot.links]),
        inertia=np.array([link.inertia.tensor for link in robot.links]),
        rotor=np.array([joint.rotor_inertia for joint in robot.joints[:moving]]),
    )


def surfaces(robot: Robot) -> Surfaces:
    """Primitives of all links."""
    return pack(robot.links)


def obstacle_arrays(obstacles: Sequence[Obstacle]) -> Obstacles:
    """Arrays of obstacles, in order."""
    count = len(obstacles)
    kind = np.zeros(count, dtype=np.int64)
    rotation = np.tile(np.eye(3), (count, 1, 1))
    origin, half, radius = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count)
    for i, obstacle in enumerate(obstacles):
        match obstacle:
            case HalfSpace():
                kind[i], origin[i] = HALF_SPACE, obstacle.point
                rotation[i, :, 2] = np.array(obstacle.normal) / np.linalg.norm(obstacle.normal)
            case BoxObstacle():
                kind[i], origin[i] = BOX, obstacle.center
                rotation[i] = rotation_from_rpy(obstacle.rpy)
                half[i] = np.array(obstacle.half) - obstacle.rounding
                radius[i] = obstacle.rounding
            case SphereObstacle():
                kind[i], origin[i], radius[i] = SPHERE, obstacle.center, obstacle.radius
    return Obstacles(
        kind,
        rotation,
        origin,
        half,
        radius,
        np.array([obstacle.stiffness for obstacle in obstacles]),
        np.array([obstacle.damping for obstacle in obstacles]),
        np.array([obstacle.friction for obstacle in obstacles]),
    )
