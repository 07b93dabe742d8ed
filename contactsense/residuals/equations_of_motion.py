"""Equations of motion for the momentum observers, as h and drift with dh/dt = drift + external.

A contact at a fixed point of link k has a constant wrench in that link's frame, while the wrench turns and
travels in base axes. Low-passed in base axes it would lag behind the arm: by 16 mm at 1 m/s and 10 Hz. So the
base wrench is observed in the frame of every body at once, and each hypothesis "contact on link k" uses its
own. In a frame that moves with the twist V, with X the wrench transform into that frame,

    d(X H)/dt = X ( dH/dt - V x* H ),

so the same observer applies. The base wrench is subtracted from the torques before both are low-passed: for a
joint j proximal to the contact, r_j - s_j . y is noise at every instant, however the arm moves, and so is its
low-pass.
"""

from typing import NamedTuple

import numpy as np

from contactsense.kinematics.model import Model, Motion
from contactsense.kinematics.spatial import dot6
from contactsense.residuals.joint_friction import JointTorqueModel, friction_torque, unmodelled_torque_std
from contactsense.residuals.momentum_observer import MomentumObserver, Step, advance, start_step
from contactsense.residuals.observers import Observers
from contactsense.robots.jit.kernel import inlined_kernel, kernel
from contactsense.robots.vectors import (
    Vector,
    add_cross,
    cross,
    dot,
    subtract,
    subtract_cross,
    vector,
)


class JointEquation(NamedTuple):
    """The equation of one joint torque at one sample."""

    momentum: float
    """h [Nms]."""
    drift: float
    """[Nm]"""
    std: float
    """Standard deviation of the model error [Nm]."""
    friction: float
    """Friction torque [Nm]."""


@inlined_kernel
def _joint_equation(
    model: Model, torque_model: JointTorqueModel, motion: Motion, qd: np.ndarray, torque: np.ndarray, j: int
) -> JointEquation:
    """The equation of joint j, for the contents of its torque signal."""
    s, H = motion.screw[j], motion.momentum[j + 1]
    weight = dot6(s, motion.gravity[j + 1])
    h = torque_model.inertia * (dot6(s, H) + model.rotor_inertia[j] * qd[j])
    known = torque_model.inertia * dot6(motion.screw_rate[j], H) + torque_model.gravity * weight
    friction = friction_torque(torque_model, j, qd[j], weight)
    drift = known + torque[j] - (torque_model.bias[j] + friction)
    return JointEquation(h, drift, unmodelled_torque_std(torque_model, j, qd[j]), friction)


@inlined_kernel
def follow_errors(
    j: int,
    std: float,
    friction: float,
    step: Step,
    low_passed_std: np.ndarray,
    low_passed_friction: np.ndarray,
) -> None:
    """Low-pass model error and friction of joint j as its residual is.

    Args:
        j: The joint.
        std: Standard deviation of its model error [Nm].
        friction: Its friction torque [Nm].
        step: As for `contactsense.residuals.momentum_observer.advance`.
        low_passed_std, low_passed_friction: Changed in place, shape (n,) [Nm].
    """
    low_passed_std[j] = std + step.a * (low_passed_std[j] - std)
    low_passed_friction[j] = friction + step.a * (low_passed_friction[j] - friction)


@inlined_kernel
def _advance_difference(
    state: MomentumObserver, j: int, found: JointEquation, motion: Motion, wrench: np.ndarray, step: Step
) -> None:
    """Advance the difference of joint j's torque, whose equation is `found`, to that of the base wrench."""
    s, H, G = motion.screw[j], motion.momentum[0], motion.gravity[0]
    h = found.momentum - dot6(s, H)
    drift = found.drift - (dot6(motion.screw_rate[j], H) + dot6(s, G) - dot6(s, wrench))
    advance(state, j, h, drift, step)


@inlined_kernel
def advance_torques(
    model: Model,
    torque_model: JointTorqueModel,
    motion: Motion,
    readings: tuple[np.ndarray, np.ndarray, np.ndarray],
    dt: tuple[float, float],
    steps: tuple[Step, Step],
    observers: Observers,
    unmodelled_std: np.ndarray,
    friction: np.ndarray,
) -> None:
    """Advance by one sample the residual of each joint torque, s_j . w_ext, and that of its difference to the
    torque that the base wrench predicts, s_j . w_ext - s_j . y_ext.

    Args:
        model, motion: The arm, and its motion after `contactsense.kinematics.momenta.kinematics_and_momenta`
            for this sample.
        torque_model: Contents of the joint torque signal.
        readings: Joint velocities, shape (n,) [rad/s]; torque of each actuator, shape (n,) [Nm]; wrench of
            the arm on the base sensor, base axes, base origin, shape (6,) [N, Nm].
        dt: Time since the last torques, and since the last sample with both sensors [s]; 0 restarts,
            negative: no value in this sample.
        steps: For the same two, see `contactsense.residuals.observers.start_steps`.
        observers: `joints` and `torque_difference` are changed in place.
        unmodelled_std: Changed in place: standard deviation of each residual's model error, shape (n,) [Nm].
        friction: Changed in place: friction of each joint, low-passed as the residual is, shape (n,) [Nm].
    """
    qd, torque, wrench = readings
    if dt[0] < 0.0:
        return
    for j in range(qd.shape[0]):
        found = _joint_equation(model, torque_model, motion, qd, torque, j)
        advance(observers.joints, j, found.momentum, found.drift, steps[0])
        follow_errors(j, found.std, found.friction, steps[0], unmodelled_std, friction)
        if dt[1] >= 0.0:
            _advance_difference(observers.torque_difference, j, found, motion, wrench, steps[1])


@kernel
def observe_joints(
    model: Model,
    torque_model: JointTorqueModel,
    motion: Motion,
    qd: np.ndarray,
    torque: np.ndarray,
    dt: float,
    bandwidth: float,
    state: MomentumObserver,
) -> None:
    """Advance the residuals of the joint torques alone by one sample.

    Args:
        model, torque_model, motion: As for `advance_torques`.
        qd: Joint velocities, shape (n,) [rad/s].
        torque: Torque of each actuator, shape (n,) [Nm].
        dt: Time since the last sample [s]; 0 restarts.
        bandwidth: Cut-off frequency [Hz].
        state: Changed in place, n equations.
    """
    step = start_step(state, dt, bandwidth)
    for j in range(qd.shape[0]):
        found = _joint_equation(model, torque_model, motion, qd, torque, j)
        advance(state, j, found.momentum, found.drift, step)


@kernel
def observe_wrench(
    momentum: np.ndarray,
    gravity: np.ndarray,
    wrench: np.ndarray,
    dt: float,
    bandwidth: float,
    state: MomentumObserver,
) -> None:
    """Advance the residual of a force/torque sensor by one sample, in base axes.

    Args:
        momentum: Linear and angular momentum of the sensor's load about the base origin, shape (6,).
        gravity: Gravity wrench on the load, shape (6,) [N, Nm].
        wrench: Wrench of the load on the sensor, shape (6,) [N, Nm].
        dt: Time since the last sample [s]; 0 restarts.
        bandwidth: Cut-off frequency [Hz].
        state: Changed in place, six equations.
    """
    step = start_step(state, dt, bandwidth)
    for i in range(6):
        advance(state, i, momentum[i], gravity[i] - wrench[i], step)


@inlined_kernel
def advance_base(motion: Motion, wrench: np.ndarray, step: Step, state: MomentumObserver) -> None:
    """Advance the residual of the base sensor by one sample, in the frame of every body.

    Args:
        motion: After `contactsense.kinematics.momenta.kinematics_and_momenta` for this sample.
        wrench: Wrench of the arm on the base sensor, base axes, base origin, shape (6,) [N, Nm].
        step: See `contactsense.residuals.observers.start_steps`.
        state: Changed in place, six equations per body, base first.
    """
    H, G = motion.momentum[0], motion.gravity[0]
    p, L = vector(H), vector(H[3:])
    force = subtract(vector(G), vector(wrench))
    moment = subtract(vector(G[3:]), vector(wrench[3:]))
    for body in range(motion.rotation.shape[0]):
        V, R = motion.twist[body], motion.rotation[body]
        o = vector(motion.origin[body])
        m, d, e = equation_in_frame(p, L, force, moment, o, vector(V), vector(V[3:]))
        for i in range(3):
            axis = (R[0, i], R[1, i], R[2, i])
            at = 6 * body + i
            advance(state, at, dot(axis, p), dot(axis, d), step)
            advance(state, at + 3, dot(axis, m), dot(axis, e), step)


@inlined_kernel
def equation_in_frame(
    p: Vector, L: Vector, force: Vector, moment: Vector, origin: Vector, velocity: Vector, angular: Vector
) -> tuple[Vector, Vector, Vector]:
    """The equation of the base wrench in a moving frame, in base axes.

    Args:
        p, L: Linear and angular momentum of the arm about the base origin [Ns, Nms].
        force, moment: Gravity wrench less the wrench of the arm on the base sensor [N, Nm].
        origin: Of the frame [m].
        velocity, angular: Twist of the frame [m/s, rad/s].

    Returns:
        Angular momentum about the frame's origin [Nms]; and drift of linear and angular momentum there [N,
        Nm].
    """
    d = subtract(force, cross(angular, p))
    e = subtract(moment, add_cross(cross(angular, L), velocity, p))
    return subtract_cross(L, origin, p), d, subtract_cross(e, origin, d)


@kernel
def wrenches_to_base_frame(motion: Motion, residual: np.ndarray, out: np.ndarray) -> None:
    """Transform wrenches from the frames of the bodies to base axes, about the base origin.

    Args:
        motion: Poses.
        residual: Six numbers per body, base first, shape (6 (n + 1),) [N, Nm].
        out: Filled, shape (n + 1, 6).
    """
    for body in range(motion.rotation.shape[0]):
        R, o = motion.rotation[body], motion.origin[body]
        r = residual[6 * body : 6 * body + 6]
        for i in range(3):
            out[body, i] = R[i, 0] * r[0] + R[i, 1] * r[1] + R[i, 2] * r[2]
            out[body, i + 3] = R[i, 0] * r[3] + R[i, 1] * r[4] + R[i, 2] * r[5]
        fx, fy, fz = out[body, 0], out[body, 1], out[body, 2]
        out[body, 3] += o[1] * fz - o[2] * fy
        out[body, 4] += o[2] * fx - o[0] * fz
        out[body, 5] += o[0] * fy - o[1] * fx


@kernel
def wrench_difference(
    motion: Motion, first: np.ndarray, second: np.ndarray, body: int, out: np.ndarray
) -> None:
    """First minus second of two wrenches given in a body's frame, in base axes, about the base origin.

    Args:
        motion: Poses.
        first, second: Six numbers per body, base first; more may follow [N, Nm].
        body: Index of the body.
        out: Filled, shape (6,).
    """
    R, o = motion.rotation[body], motion.origin[body]
    at = 6 * body
    for i in range(3):
        f, m = 0.0, 0.0
        for k in range(3):
            f += R[i, k] * (first[at + k] - second[at + k])
            m += R[i, k] * (first[at + 3 + k] - second[at + 3 + k])
        out[i] = f
        out[i + 3] = m
    out[3] += o[1] * out[2] - o[2] * out[1]
    out[4] += o[2] * out[0] - o[0] * out[2]
    out[5] += o[0] * out[1] - o[1] * out[0]


@kernel
def observe_wrench_difference(
    motion: Motion,
    momentum: np.ndarray,
    gravity: np.ndarray,
    link_wrench: np.ndarray,
    wrench: np.ndarray,
    dt: float,
    bandwidth: float,
    state: MomentumObserver,
) -> None:
    """Advance by one sample the residual of a link sensor minus that of the base sensor, base axes, base
    origin.

    Args:
        motion: After `contactsense.kinematics.momenta.kinematics_and_momenta` for this sample.
        momentum, gravity: Of the link sensor's load, as for `observe_wrench`.
        link_wrench, wrench: Wrenches on the link sensor and on the base sensor, shape (6,) [N, Nm].
        dt: Time since the last sample with both sensors [s]; 0 restarts.
        bandwidth: Cut-off frequency [Hz].
        state: Changed in place, six equations.
    """
    step = start_step(state, dt, bandwidth)
    for i in range(6):
        drift = gravity[i] - link_wrench[i] - motion.gravity[0, i] + wrench[i]
        advance(state, i, momentum[i] - motion.momentum[0, i], drift, step)
