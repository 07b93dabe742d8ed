"""Simulation of the arm and its sensors, step by step, while servos follow a target."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contactsense.robots import Robot
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.robots.tool import Tool
from contactsense.robots.torque_scale import torque_scales
from contactsense.service.mock.arm.obstacles import Obstacle
from contactsense.service.mock.physics import bodies as arrays
from contactsense.service.mock.physics.dynamics_kernels import scratch
from contactsense.service.mock.physics.servo_kernels import (
    BIAS,
    EXTERNAL,
    GRAVITY,
    Servo,
    State,
    advance,
    set_acceleration,
)

STEP = 1e-3
"""Time between two readings [s]."""
SUBSTEPS = 5
"""Integration steps per `STEP`."""
SERVO_STIFFNESS = 100.0
"""Torque of a servo per position error, relative to the drive's limit [1/rad]: full torque at 10 mrad."""


class ObstacleContact(NamedTuple):
    """A contact with an obstacle at an instant."""

    obstacle: int
    """Number of the obstacle."""
    link: int
    """Number of the touched link; the tool is the last."""
    depth: float
    """Penetration depth of the surface in the obstacle [m]."""
    point: np.ndarray
    """Deepest point, base frame [m], shape (3,)."""
    force: np.ndarray
    """Force on the robot, base axes [N], shape (3,)."""


class Push(NamedTuple):
    """A wrench on a link, in the link's axes."""

    link: int
    """Number of the link."""
    force: np.ndarray
    """Force [N], shape (3,)."""
    moment: np.ndarray
    """Moment about the link frame's origin [Nm], shape (3,)."""


class ArmSimulation:
    """An arm, initially at rest at joint positions q; `step` advances it by `STEP`.

    Deterministic: the same targets and pushes give the same results.

    Args:
        robot: The arm.
        q: Joint positions at the beginning [rad], shape (n,).
        tool: Tool at the flange.
        obstacles: Obstacles in the cell.
        gravity: Acceleration of free fall, base axes [m/s^2].
    """

    def __init__(
        self,
        robot: Robot,
        q: Sequence[float] | np.ndarray,
        *,
        tool: Tool | None = None,
        obstacles: Sequence[Obstacle] = (),
        gravity: Sequence[float] = (0.0, 0.0, -9.81),
    ) -> None:
        joints = len(robot.joints)
        self.robot = arrays.with_tool(robot, tool)
        """The arm with its tool as an additional link on a fixed joint."""
        self._bodies = arrays.bodies(self.robot, joints)
        self._surfaces = arrays.surfaces(self.robot)
        self._obstacles = arrays.obstacle_arrays(obstacles)
        limit = np.array([joint.torque_limit for joint in robot.joints])
        self._servo = Servo(SERVO_STIFFNESS * torque_scales(robot), limit)
        self._fall = np.array(gravity, dtype=float)
        links = len(self.robot.links)
        start = np.array(q, dtype=float)
        self._state = State(
            q=start.copy(),
            qd=np.zeros(joints),
            qdd=np.zeros(joints),
            target=np.vstack([start, np.zeros((2, joints))]),
            pushes=np.zeros((links, 6)),
            contacts=np.zeros((len(obstacles), links, 7)),
            pose=np.zeros((4, 3)),
            rows=np.zeros((6, joints)),
            torque=np.zeros(joints),
        )
        self._work = scratch(links, joints)
        set_acceleration(*self._arguments, STEP / SUBSTEPS, self._state, self._work)
        # No step, but its kernel: compiled only when the arm moves, it would hold up the sensors' readings.
        advance(*self._arguments, STEP / SUBSTEPS, 0, self._state, self._work)

    @property
    def _arguments(self) -> tuple[arrays.Bodies, Surfaces, arrays.Obstacles, Servo, np.ndarray]:
        return self._bodies, self._surfaces, self._obstacles, self._servo, self._fall

    def step(self, target: np.ndarray, pushes: Sequence[Push] = ()) -> None:
        """Advance by `STEP`.

        Args:
            target: Target positions [rad], velocities and accelerations at the beginning of the step, shape
                (3, n).
            pushes: Wrenches on the links during the step.
        """
        state = self._state
        state.target[:] = target
        state.pushes[:] = 0.0
        for push in pushes:
            state.pushes[push.link, :3] += push.force
            state.pushes[push.link, 3:] += push.moment
        advance(*self._arguments, STEP / SUBSTEPS, SUBSTEPS, state, self._work)

    @property
    def q(self) -> np.ndarray:
        """Joint positions [rad], shape (n,)."""
        return self._state.q.copy()

    @property
    def qd(self) -> np.ndarray:
        """Joint velocities [rad/s], shape (n,)."""
        return self._state.qd.copy()

    @property
    def qdd(self) -> np.ndarray:
        """Joint accelerations [rad/s^2], shape (n,)."""
        return self._state.qdd.copy()

    @property
    def torque(self) -> np.ndarray:
        """Torques that the actuators apply [Nm], shape (n,)."""
        return self._state.torque.copy()

    @property
    def model_torque(self) -> np.ndarray:
        """Torques for the target's acceleration without any contact [Nm], shape (n,)."""
        return np.asarray(self._state.rows[BIAS] + self._work.mass @ self._state.target[2])

    @property
    def external_torque(self) -> np.ndarray:
        """Joint torques due to contacts and pushes [Nm], shape (n,)."""
        return np.array(self._state.rows[EXTERNAL])

    @property
    def gravity_torque(self) -> np.ndarray:
        """Torques that hold the arm against gravity [Nm], shape (n,)."""
        return np.array(self._state.rows[GRAVITY])

    @property
    def target(self) -> np.ndarray:
        """Target positions, velocities and accelerations [rad, s], shape (3, n)."""
        return self._state.target.copy()

    @property
    def external_wrench(self) -> np.ndarray:
        """Total wrench of contacts and pushes on the arm: force, then moment about the base origin, base axes
        [N, Nm], shape (6,)."""
        total = np.zeros(6)
        for link in np.flatnonzero(self._work.load.any(axis=1)):
            force = self._work.rotation[link] @ self._work.load[link, :3]
            moment = self._work.rotation[link] @ self._work.load[link, 3:]
            # As numbers: numpy.cross would take longer than all the rest.
            (x, y, z), (fx, fy, fz) = self._work.origin[link].tolist(), force.tolist()
            total[:3] += force
            total[3:] += moment
            total[3:] += (y * fz - z * fy, z * fx - x * fz, x * fy - y * fx)
        return total

    @property
    def base_wrench(self) -> np.ndarray:
        """Wrench of the arm on the sensor below it: force, then moment about the base origin, base axes
        [N, Nm], shape (6,)."""
        return np.asarray(-self._work.wrench[0])

    @property
    def last_link_wrench(self) -> np.ndarray:
        """Wrench of the last link (the tool, if there is one) on the body that carries it, in its own axes
        about its own origin [N, Nm], shape (6,)."""
        return self.link_wrench(-1)

    def link_wrench(self, link: int) -> np.ndarray:
        """Wrench of a link and everything beyond it on the body that carries it, in the link's axes about its
        origin [N, Nm], shape (6,)."""
        return np.asarray(-self._work.wrench[link])

    @property
    def rotations(self) -> np.ndarray:
        """Orientation of all links, base axes, shape (B, 3, 3)."""
        return self._work.rotation.copy()

    @property
    def origins(self) -> np.ndarray:
        """Origins of all links, base frame [m], shape (B, 3)."""
        return self._work.origin.copy()

    def twist(self, link: int) -> np.ndarray:
        """Velocity of a link's origin and its angular velocity, base axes [m/s, rad/s], shape (6,)."""
        rotation = self._work.rotation[link]
        return np.concatenate([rotation @ self._work.velocity[link], rotation @ self._work.omega[link]])

    @property
    def contacts(self) -> list[ObstacleContact]:
        """Present contacts with obstacles."""
        rows = self._state.contacts
        if not rows[:, :, 0].any():
            return []
        return [
            ObstacleContact(
                int(i), int(link), float(rows[i, link, 0]), *np.split(rows[i, link, 1:].copy(), 2)
            )
            for i, link in np.argwhere(rows[:, :, 0] > 0.0)
        ]
