"""One step of the arm under its joint servos, in contact or not.

Each joint's servo is a spring and a damper between target and actual position, added to the torque that the
controller's own model computes. With M(q) a + h(q, qd) = torque + J^T f and the errors e, e' of position and
velocity relative to the target,

    M (a - a_target) = K e + D e' + J^T f

The torque of a drive saturates at its limit; beyond it the arm yields. The servo is integrated implicitly in
e, because its stiffness and the small inertia of a wrist would otherwise require a tiny step. The contact is
integrated explicitly.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.service.mock.physics.bodies import Bodies, Obstacles
from contactsense.service.mock.physics.contact_kernels import add_contacts
from contactsense.service.mock.physics.dynamics_kernels import (
    Scratch,
    inverse_dynamics,
    set_mass_matrix,
    set_poses,
    set_velocities,
    solve,
)

BIAS = 0
"""Row of `State.rows`: torques due to gravity and velocity, h(q, qd)."""
EXTERNAL = 1
"""Row of `State.rows`: joint torques due to contacts and pushes, J^T f."""
GRAVITY = 2
"""Row of `State.rows`: torques that hold the arm against gravity."""


class Servo(NamedTuple):
    """Joint servos of n joints."""

    stiffness: np.ndarray
    """Torque per position error [Nm/rad], shape (n,)."""
    limit: np.ndarray
    """Largest torque of each drive [Nm], shape (n,)."""


class State(NamedTuple):
    """The arm's state at an instant, and quantities derived from it; n joints, B bodies, M obstacles."""

    q: np.ndarray
    """Joint positions [rad], shape (n,)."""
    qd: np.ndarray
    """Joint velocities [rad/s], shape (n,)."""
    qdd: np.ndarray
    """Joint accelerations [rad/s^2], shape (n,)."""
    target: np.ndarray
    """Target positions, velocities and accelerations at this instant, shape (3, n)."""
    pushes: np.ndarray
    """Scripted wrenches on the bodies, own axes: force, moment about the origin [N, Nm], shape (B, 6)."""
    contacts: np.ndarray
    """For each obstacle and body: depth [m], point (3) [m], force on the robot (3) [N], base frame, shape
    (M, B, 7)."""
    pose: np.ndarray
    """Scratch, shape (4, 3)."""
    rows: np.ndarray
    """Vectors of the equations of motion, shape (6, n) [Nm]: `BIAS`, `EXTERNAL`, `GRAVITY` and scratch."""
    torque: np.ndarray
    """Torques of the actuators [Nm], shape (n,)."""


@kernel
def set_acceleration(
    bodies: Bodies,
    surfaces: Surfaces,
    obstacles: Obstacles,
    servo: Servo,
    fall: np.ndarray,
    dt: float,
    state: State,
    work: Scratch,
) -> None:
    """Fill `qdd`, `torque` and `contacts` of the state, and `wrench` of the scratch, from the rest of it.

    Args:
        bodies, surfaces, obstacles, servo: The arm and its environment.
        fall: Acceleration of free fall, base axes [m/s^2], shape (3,).
        dt: Integration step of the servo [s].
        state, work: Filled.
    """
    n = state.q.shape[0]
    bias, external, gravity = state.rows[BIAS], state.rows[EXTERNAL], state.rows[GRAVITY]
    stiff, right, still = state.rows[3], state.rows[4], state.pose[0]
    set_poses(bodies, state.q, work)
    set_velocities(bodies, state.qd, work)
    for j in range(work.load.shape[0]):
        for i in range(6):
            work.load[j, i] = state.pushes[j, i]
    add_contacts(surfaces, obstacles, work, state.pose, state.contacts)
    for i in range(n):
        right[i] = 0.0
    inverse_dynamics(bodies, 1.0, right, fall, 0.0, work, bias)
    inverse_dynamics(bodies, 1.0, right, fall, 1.0, work, external)
    inverse_dynamics(bodies, 0.0, right, fall, 0.0, work, gravity)
    still[0] = still[1] = still[2] = 0.0
    set_mass_matrix(bodies, still, work)
    for i in range(n):
        external[i] = bias[i] - external[i]  # J^T f
        k = servo.stiffness[i]
        damping = 2.0 * sqrt(k * work.mass[i, i])  # critical
        stiff[i] = dt * (damping + dt * k)
        off, off_rate = state.target[0, i] - state.q[i], state.target[1, i] - state.qd[i]
        right[i] = k * (off + dt * off_rate) + damping * off_rate + external[i]
    solve(work.mass, stiff, right, work.factor, state.qdd)
    beyond = False
    for i in range(n):
        state.qdd[i] += state.target[2, i]
    for i in range(n):
        torque = bias[i] - external[i]
        for k in range(n):
            torque += work.mass[i, k] * state.qdd[k]
        beyond = beyond or abs(torque) > servo.limit[i]
        state.torque[i] = min(max(torque, -servo.limit[i]), servo.limit[i])
        right[i] = state.torque[i] - bias[i] + external[i]
    if beyond:
        for i in range(n):
            stiff[i] = 0.0
        solve(work.mass, stiff, right, work.factor, state.qdd)
    inverse_dynamics(bodies, 1.0, state.qdd, fall, 1.0, work, state.torque)


@kernel
def advance(
    bodies: Bodies,
    surfaces: Surfaces,
    obstacles: Obstacles,
    servo: Servo,
    fall: np.ndarray,
    dt: float,
    steps: int,
    state: State,
    work: Scratch,
) -> None:
    """Integrate the given number of steps of `dt` [s] by semi-implicit Euler; the target advances with its
    own acceleration."""
    for _ in range(steps):
        for i in range(state.q.shape[0]):
            state.qd[i] += dt * state.qdd[i]
            state.q[i] += dt * state.qd[i]
            state.target[0, i] += dt * (state.target[1, i] + 0.5 * dt * state.target[2, i])
            state.target[1, i] += dt * state.target[2, i]
        set_acceleration(bodies, surfaces, obstacles, servo, fall, dt, state, work)
