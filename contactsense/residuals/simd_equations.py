"""The equations of motion of `contactsense.residuals.equations_of_motion` for eight samples at once, with the
same digits; and one step of the observers from them.

They extend the work array of `contactsense.kinematics.simd_kinematics`.
"""

import numpy as np

from contactsense.kinematics.model import Model
from contactsense.residuals.equations_of_motion import follow_errors
from contactsense.residuals.joint_friction import JointTorqueModel, friction_torque, unmodelled_torque_std
from contactsense.residuals.momentum_observer import MomentumObserver, Step, advance
from contactsense.robots.jit.array_views import view
from contactsense.robots.jit.kernel import inlined_kernel, kernel
from contactsense.robots.jit.lanes import LANES

from contactsense.kinematics.simd_kinematics import (  # isort: skip
    A0, A1, A2, A3, A4, A5, BODY, G0, G1, G2, G3, G4, G5, H0, H1, H2, H3, H4, H5, OX, OY, OZ, R00, R01,
    R02, R10, R11, R12, R20, R21, R22, S0, S1, S2, S3, S4, S5, SPEED, V0, V1, V2, V3, V4, V5,
)  # fmt: skip

(
    TOTAL0, TOTAL1, TOTAL2, TOTAL3, TOTAL4, TOTAL5,
    WEIGHT0, WEIGHT1, WEIGHT2, WEIGHT3, WEIGHT4, WEIGHT5,
    WRENCH0, WRENCH1, WRENCH2, WRENCH3, WRENCH4, WRENCH5,
) = range(G5 + LANES, G5 + 19 * LANES, LANES)  # fmt: skip
BASE_MOMENTUM, BASE_DRIFT = G5 + 19 * LANES, G5 + 25 * LANES
TORQUE, FRICTION, MODEL_STD, JOINT_MOMENTUM, JOINT_DRIFT, DIFFERENCE_MOMENTUM, DIFFERENCE_DRIFT = range(
    G5 + 31 * LANES, BODY, LANES
)
"""Offsets of a body's quantities, beyond those of the kinematics. `TOTAL0` to `TOTAL5` and `WEIGHT0` to
`WEIGHT5`: momentum and gravity wrench of the whole arm; `WRENCH0` to `WRENCH5`: wrench on the base sensor
without its bias; the same for every body, so that each finds them at a constant distance. `BASE_MOMENTUM`,
`BASE_DRIFT`: h and drift of the base wrench in the body's frame, six quantities each. Of the joint that
carries the body: `TORQUE` of the actuator, `FRICTION`, `MODEL_STD` the standard deviation of the
model error, and h and drift of its torque and of its difference to the base wrench."""


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
            base[WRENCH0 + LANES * e + k] = base_wrench[min(first + k, last), e] - bias[e]
    for k in range(H0, G5 + LANES):
        base[TOTAL0 - H0 + k] = base[k]
    _base_equations(base)
    for j in range(n):
        body = view(lanes, (j + 1) * BODY, (BODY,))
        for k in range(TOTAL0, BASE_MOMENTUM):
            body[k] = base[k]
        _base_equations(body)
        for k in range(LANES):
            body[TORQUE + k] = torque[min(first + k, last), j]
        for k in range(LANES):
            weight = (
                body[S0 + k] * body[G0 + k] + body[S1 + k] * body[G1 + k] + body[S2 + k] * body[G2 + k]
                + body[S3 + k] * body[G3 + k] + body[S4 + k] * body[G4 + k] + body[S5 + k] * body[G5 + k]
            )  # fmt: skip
            friction = friction_torque(torque_model, j, body[SPEED + k], weight)
            body[FRICTION + k] = friction
            body[MODEL_STD + k] = unmodelled_torque_std(torque_model, j, body[SPEED + k])
        _joint_equations(model, torque_model, j, body)


@kernel
def _base_equations(body: np.ndarray) -> None:
    """As `contactsense.residuals.equations_of_motion.advance_base` for one body."""
    for k in range(LANES):
        hx, hy, hz = body[TOTAL0 + k], body[TOTAL1 + k], body[TOTAL2 + k]
        lx, ly, lz = body[TOTAL3 + k], body[TOTAL4 + k], body[TOTAL5 + k]
        vx, vy, vz = body[V0 + k], body[V1 + k], body[V2 + k]
        wx, wy, wz = body[V3 + k], body[V4 + k], body[V5 + k]
        dx = body[WEIGHT0 + k] - body[WRENCH0 + k] - (wy * hz - wz * hy)
        dy = body[WEIGHT1 + k] - body[WRENCH1 + k] - (wz * hx - wx * hz)
        dz = body[WEIGHT2 + k] - body[WRENCH2 + k] - (wx * hy - wy * hx)
        ex = body[WEIGHT3 + k] - body[WRENCH3 + k] - (wy * lz - wz * ly + vy * hz - vz * hy)
        ey = body[WEIGHT4 + k] - body[WRENCH4 + k] - (wz * lx - wx * lz + vz * hx - vx * hz)
        ez = body[WEIGHT5 + k] - body[WRENCH5 + k] - (wx * ly - wy * lx + vx * hy - vy * hx)
        ox, oy, oz = body[OX + k], body[OY + k], body[OZ + k]
        mx, my, mz = lx - oy * hz + oz * hy, ly - oz * hx + ox * hz, lz - ox * hy + oy * hx
        ex, ey, ez = ex - oy * dz + oz * dy, ey - oz * dx + ox * dz, ez - ox * dy + oy * dx
        a, b, c = body[R00 + k], body[R10 + k], body[R20 + k]
        body[BASE_MOMENTUM + k] = a * hx + b * hy + c * hz
        body[BASE_DRIFT + k] = a * dx + b * dy + c * dz
        body[BASE_MOMENTUM + 3 * LANES + k] = a * mx + b * my + c * mz
        body[BASE_DRIFT + 3 * LANES + k] = a * ex + b * ey + c * ez
        a, b, c = body[R01 + k], body[R11 + k], body[R21 + k]
        body[BASE_MOMENTUM + LANES + k] = a * hx + b * hy + c * hz
        body[BASE_DRIFT + LANES + k] = a * dx + b * dy + c * dz
        body[BASE_MOMENTUM + 4 * LANES + k] = a * mx + b * my + c * mz
        body[BASE_DRIFT + 4 * LANES + k] = a * ex + b * ey + c * ez
        a, b, c = body[R02 + k], body[R12 + k], body[R22 + k]
        body[BASE_MOMENTUM + 2 * LANES + k] = a * hx + b * hy + c * hz
        body[BASE_DRIFT + 2 * LANES + k] = a * dx + b * dy + c * dz
        body[BASE_MOMENTUM + 5 * LANES + k] = a * mx + b * my + c * mz
        body[BASE_DRIFT + 5 * LANES + k] = a * ex + b * ey + c * ez


@kernel
def _joint_equations(model: Model, torque_model: JointTorqueModel, j: int, body: np.ndarray) -> None:
    """As `contactsense.residuals.equations_of_motion.advance_torques` for one joint."""
    inertia, gravity, bias, rotor = (
        torque_model.inertia, torque_model.gravity, torque_model.bias[j], model.rotor_inertia[j],
    )  # fmt: skip
    for k in range(LANES):
        s0, s1, s2 = body[S0 + k], body[S1 + k], body[S2 + k]
        s3, s4, s5 = body[S3 + k], body[S4 + k], body[S5 + k]
        a0, a1, a2 = body[A0 + k], body[A1 + k], body[A2 + k]
        a3, a4, a5 = body[A3 + k], body[A4 + k], body[A5 + k]
        h0, h1, h2 = body[H0 + k], body[H1 + k], body[H2 + k]
        h3, h4, h5 = body[H3 + k], body[H4 + k], body[H5 + k]
        along = s0 * h0 + s1 * h1 + s2 * h2 + s3 * h3 + s4 * h4 + s5 * h5
        rate = a0 * h0 + a1 * h1 + a2 * h2 + a3 * h3 + a4 * h4 + a5 * h5
        weight = (
            s0 * body[G0 + k] + s1 * body[G1 + k] + s2 * body[G2 + k]
            + s3 * body[G3 + k] + s4 * body[G4 + k] + s5 * body[G5 + k]
        )  # fmt: skip
        h = inertia * (along + rotor * body[SPEED + k])
        known = inertia * rate + gravity * weight
        drift = known + body[TORQUE + k] - (bias + body[FRICTION + k])
        body[JOINT_MOMENTUM + k] = h
        body[JOINT_DRIFT + k] = drift
        t0, t1, t2 = body[TOTAL0 + k], body[TOTAL1 + k], body[TOTAL2 + k]
        t3, t4, t5 = body[TOTAL3 + k], body[TOTAL4 + k], body[TOTAL5 + k]
        total = s0 * t0 + s1 * t1 + s2 * t2 + s3 * t3 + s4 * t4 + s5 * t5
        total_rate = a0 * t0 + a1 * t1 + a2 * t2 + a3 * t3 + a4 * t4 + a5 * t5
        total_weight = (
            s0 * body[WEIGHT0 + k] + s1 * body[WEIGHT1 + k] + s2 * body[WEIGHT2 + k]
            + s3 * body[WEIGHT3 + k] + s4 * body[WEIGHT4 + k] + s5 * body[WEIGHT5 + k]
        )  # fmt: skip
        measured = (
            s0 * body[WRENCH0 + k] + s1 * body[WRENCH1 + k] + s2 * body[WRENCH2 + k]
            + s3 * body[WRENCH3 + k] + s4 * body[WRENCH4 + k] + s5 * body[WRENCH5 + k]
        )  # fmt: skip
        body[DIFFERENCE_MOMENTUM + k] = h - total
        body[DIFFERENCE_DRIFT + k] = drift - (total_rate + total_weight - measured)


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
