"""The equations of motion of `contactsense.residuals.equations_of_motion` for eight samples at once, with the
same digits; and one step of the observers from them.

They extend the work array of `contactsense.kinematics.simd_kinematics`.
"""

import numpy as np

from contactsense.kinematics.body_motion import transposed_matvec
from contactsense.kinematics.model import Model
from contactsense.kinematics.simd_kinematics import (
    BODY,
    GRAVITY,
    KINEMATICS,
    MOMENTUM,
    ORIGIN,
    ROTATION,
    SCREW,
    SCREW_RATE,
    SPEED,
    TWIST,
    put_vector,
    rows_at,
    six_at,
    vector_at,
)
from contactsense.kinematics.spatial import dot6
from contactsense.residuals.equations_of_motion import equation_in_frame, follow_errors
from contactsense.residuals.joint_friction import JointTorqueModel, friction_torque, unmodelled_torque_std
from contactsense.residuals.momentum_observer import MomentumObserver, Step, advance
from contactsense.robots.jit.array_views import view
from contactsense.robots.jit.kernel import inlined_kernel, kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.vectors import subtract

TOTAL_MOMENTUM, TOTAL_WEIGHT, WRENCH, BASE_MOMENTUM, BASE_DRIFT = range(
    KINEMATICS, KINEMATICS + 30 * LANES, 6 * LANES
)
TORQUE, FRICTION, MODEL_STD, JOINT_MOMENTUM, JOINT_DRIFT, DIFFERENCE_MOMENTUM, DIFFERENCE_DRIFT = range(
    KINEMATICS + 30 * LANES, BODY, LANES
)
"""Offsets of a body's quantities, beyond those of the kinematics. `TOTAL_MOMENTUM` and `TOTAL_WEIGHT`:
momentum and gravity wrench of the whole arm; `WRENCH`: wrench on the base sensor without its bias; the same
for every body, so that each finds them at a constant distance. `BASE_MOMENTUM`, `BASE_DRIFT`: h and drift of
the base wrench in the body's frame. These have six numbers each. Of the joint that carries the body: `TORQUE`
of the actuator, `FRICTION`, `MODEL_STD` the standard deviation of the model error, and h and drift of its
torque and of its difference to the base wrench."""


@kernel
def equations_in_lanes(
    model: Model,
    torque_model: JointTorqueModel,
    bias: np.ndarray,
    torque: np.ndarray,
    base_wrench: np.ndarray,
    first: int,
    lanes: np.ndarray,
) -> None:
    """Fill h and drift of all equations for samples `first`, `first` + 1, ...

    Args:
        model, torque_model: The arm and the contents of its torque signal.
        bias: Bias of the base wrench, shape (6,) [N, Nm].
        torque, base_wrench: Readings, shapes (N, n) [Nm] and (N, 6) [N, Nm].
        first: The first sample.
        lanes: After `contactsense.kinematics.simd_kinematics.kinematics_in_lanes`.
    """
    n, last = torque.shape[1], torque.shape[0] - 1
    base = view(lanes, 0, (BODY,))
    for e in range(6):
        for k in range(LANES):
            base[WRENCH + LANES * e + k] = base_wrench[min(first + k, last), e] - bias[e]
    for k in range(MOMENTUM, KINEMATICS):
        base[TOTAL_MOMENTUM - MOMENTUM + k] = base[k]
    _base_equations(base)
    for j in range(n):
        body = view(lanes, (j + 1) * BODY, (BODY,))
        for k in range(TOTAL_MOMENTUM, BASE_MOMENTUM):
            body[k] = base[k]
        _base_equations(body)
        for k in range(LANES):
            body[TORQUE + k] = torque[min(first + k, last), j]
        for k in range(LANES):
            weight = dot6(six_at(body, SCREW + k), six_at(body, GRAVITY + k))
            friction = friction_torque(torque_model, j, body[SPEED + k], weight)
            body[FRICTION + k] = friction
            body[MODEL_STD + k] = unmodelled_torque_std(torque_model, j, body[SPEED + k])
        _joint_equations(model, torque_model, j, body)


@kernel
def _base_equations(body: np.ndarray) -> None:
    """As `contactsense.residuals.equations_of_motion.advance_base` for one body."""
    for k in range(LANES):
        R, o = rows_at(body, ROTATION + k), vector_at(body, ORIGIN + k)
        p, L = vector_at(body, TOTAL_MOMENTUM + k), vector_at(body, TOTAL_MOMENTUM + 3 * LANES + k)
        force = subtract(vector_at(body, TOTAL_WEIGHT + k), vector_at(body, WRENCH + k))
        moment = subtract(
            vector_at(body, TOTAL_WEIGHT + 3 * LANES + k), vector_at(body, WRENCH + 3 * LANES + k)
        )
        velocity, angular = vector_at(body, TWIST + k), vector_at(body, TWIST + 3 * LANES + k)
        m, d, e = equation_in_frame(p, L, force, moment, o, velocity, angular)
        put_vector(body, BASE_MOMENTUM + k, transposed_matvec(R, p))
        put_vector(body, BASE_MOMENTUM + 3 * LANES + k, transposed_matvec(R, m))
        put_vector(body, BASE_DRIFT + k, transposed_matvec(R, d))
        put_vector(body, BASE_DRIFT + 3 * LANES + k, transposed_matvec(R, e))


@kernel
def _joint_equations(model: Model, torque_model: JointTorqueModel, j: int, body: np.ndarray) -> None:
    """As `contactsense.residuals.equations_of_motion.advance_torques` for one joint."""
    inertia, gravity, bias, rotor = (
        torque_model.inertia, torque_model.gravity, torque_model.bias[j], model.rotor_inertia[j],
    )  # fmt: skip
    for k in range(LANES):
        s, rate, H = six_at(body, SCREW + k), six_at(body, SCREW_RATE + k), six_at(body, MOMENTUM + k)
        h = inertia * (dot6(s, H) + rotor * body[SPEED + k])
        known = inertia * dot6(rate, H) + gravity * dot6(s, six_at(body, GRAVITY + k))
        drift = known + body[TORQUE + k] - (bias + body[FRICTION + k])
        body[JOINT_MOMENTUM + k] = h
        body[JOINT_DRIFT + k] = drift
        H, G = six_at(body, TOTAL_MOMENTUM + k), six_at(body, TOTAL_WEIGHT + k)
        predicted = dot6(rate, H) + dot6(s, G) - dot6(s, six_at(body, WRENCH + k))
        body[DIFFERENCE_MOMENTUM + k] = h - dot6(s, H)
        body[DIFFERENCE_DRIFT + k] = drift - predicted


@inlined_kernel
def advance_base(
    lanes: np.ndarray,
    lane: int,
    step: Step,
    state: MomentumObserver,
) -> None:
    """Advance the residual of the base sensor in the frame of every body by the sample of a lane; `step` as
    for `contactsense.residuals.momentum_observer.advance`."""
    for body in range(state.residual.shape[0] // 6):
        values = view(lanes, body * BODY + lane, (BODY,))
        for i in range(6):
            at = LANES * i
            advance(state, 6 * body + i, values[BASE_MOMENTUM + at], values[BASE_DRIFT + at], step)


@inlined_kernel
def advance_joints(
    lanes: np.ndarray,
    lane: int,
    step: Step,
    state: MomentumObserver,
    unmodelled_std: np.ndarray,
    friction: np.ndarray,
) -> None:
    """The same for the joint torques, and for the error of their model and their friction, see
    `contactsense.residuals.equations_of_motion.advance_torques`."""
    for j in range(unmodelled_std.shape[0]):
        values = view(lanes, (j + 1) * BODY + lane, (BODY,))
        advance(state, j, values[JOINT_MOMENTUM], values[JOINT_DRIFT], step)
        follow_errors(j, values[MODEL_STD], values[FRICTION], step, unmodelled_std, friction)


@inlined_kernel
def advance_torque_difference(
    lanes: np.ndarray,
    lane: int,
    step: Step,
    state: MomentumObserver,
) -> None:
    """The same for the differences of torques and base wrench."""
    for j in range(state.residual.shape[0]):
        values = view(lanes, (j + 1) * BODY + lane, (BODY,))
        advance(state, j, values[DIFFERENCE_MOMENTUM], values[DIFFERENCE_DRIFT], step)
