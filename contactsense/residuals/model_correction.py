"""Correct the model by what the filter of `contactsense.residuals.bias_filter` has learned, without a jump of
the residuals."""

import math

import numpy as np

from contactsense.kinematics.model import Model, Motion
from contactsense.kinematics.momenta import of_link_alone, per_shift_of_point_mass
from contactsense.kinematics.spatial import dot6
from contactsense.residuals.bias_filter import (
    BASE_BIASES,
    TORQUE_BIASES,
    BiasFilter,
    estimated_columns,
    friction_factors,
    masses,
    payload_place,
    regressor_of,
)
from contactsense.residuals.joint_friction import JointTorqueModel
from contactsense.residuals.momentum_observer import MomentumObserver, group_of
from contactsense.residuals.observers import Observers
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import dot, subtract, vector

MIN_RELATIVE_CHANGE = -0.5
"""Lower bound of the relative change of a mass or a friction factor in one update."""


@kernel
def apply_correction(
    bias_filter: BiasFilter,
    model: Model,
    torque_model: JointTorqueModel,
    motion: Motion,
    bandwidth: float,
    observers: Observers,
    first_body: np.ndarray,
) -> None:
    """Apply `correction` to biases, friction, masses and payload, and shift the observers to the state
    that they would have had with the corrected model.

    Args:
        bias_filter: With `correction`, which is reset to zero.
        model, torque_model: Masses, the last link with its payload, torque biases and friction factors,
            changed in place.
        motion: Of this sample.
        bandwidth: Cut-off frequency of the observers [Hz].
        observers: Changed in place.
        first_body: First link that each link sensor carries, shape (S,), int64.
    """
    n, K = torque_model.bias.shape[0], 2.0 * math.pi * bandwidth
    _correct_wrench(bias_filter, model, motion)
    for j in range(n):
        _correct_joint(bias_filter, torque_model, motion, j, K, observers)
    for s in range(first_body.shape[0]):
        _correct_link_sensor(
            bias_filter, motion, first_body[s], K, group_of(observers.links, s),
            group_of(observers.link_difference, s),
        )  # fmt: skip
    for body in range(n + 1):
        _correct_base(bias_filter, motion, body, K, observers.base)
    if bias_filter.status[0].estimates_masses:
        _correct_mass_regressor(bias_filter)
    _correct_covariance(bias_filter)
    bias_filter.correction[:] = 0.0


@kernel
def _correct_wrench(bias_filter: BiasFilter, model: Model, motion: Motion) -> None:
    """Correct the bias of the base wrench, masses and payload; `wrench_correction` is by how much that
    changes the residual of the base wrench, base axes, and the arm's momentum. Arguments as for
    `apply_correction`."""
    x, n = bias_filter.correction, bias_filter.torque_variance.shape[0]
    d_wrench, d_momentum = bias_filter.wrench_correction[0], bias_filter.wrench_correction[1]
    for i in range(6):
        bias_filter.bias[i] += x[BASE_BIASES + i]
        d_wrench[i], d_momentum[i], bias_filter.wrench_correction[2, i] = -x[BASE_BIASES + i], 0.0, 0.0
    if not bias_filter.status[0].estimates_masses:
        return
    regressor = bias_filter.mass_regressor.residual
    for k in range(n):
        at = masses(n) + k
        x[at] = max(x[at], MIN_RELATIVE_CHANGE)
        model.mass[k + 1] *= 1.0 + x[at]
        for i in range(3):
            for j in range(3):
                model.inertia[k + 1, i, j] *= 1.0 + x[at]
        for i in range(6):
            d_wrench[i] += x[at] * regressor[regressor_of(n, k) + n + i]
            d_momentum[i] += x[at] * of_link_alone(motion.momentum, k + 1)[i]
    status = bias_filter.status[0]
    if status.payload_mass > 0.0:
        status.payload_mass *= 1.0 + x[masses(n) + n - 1]
        for i in range(3):
            _add_shift(bias_filter, motion, i)
        _move_payload(bias_filter, model)


@kernel
def _add_shift(bias_filter: BiasFilter, motion: Motion, i: int) -> None:
    """Add to `wrench_correction` what the correction of coordinate i of the payload does."""
    n, change = bias_filter.torque_variance.shape[0], bias_filter.wrench_correction
    shift, first = bias_filter.correction[payload_place(n) + i], regressor_of(n, n + i) + n
    mass, place = bias_filter.status[0].payload_mass, bias_filter.payload_place
    momentum, _ = per_shift_of_point_mass(mass, place, motion, bias_filter.gravity, i)
    for k in range(6):
        change[0, k] += shift * bias_filter.mass_regressor.residual[first + k]
        change[1, k] += shift * momentum[k]
        change[2, k] += shift * momentum[k]


@kernel
def _move_payload(bias_filter: BiasFilter, model: Model) -> None:
    """Move the payload, and centre of mass and inertia of the last link with it, by the correction."""
    n = bias_filter.torque_variance.shape[0]
    at, place = payload_place(n), bias_filter.payload_place
    mass = bias_filter.status[0].payload_mass
    share = mass / model.mass[n]
    shift = vector(bias_filter.correction[at : at + 3])
    arm = subtract(vector(place), vector(model.com[n]))
    # The parallel-axis theorem, for a payload at distance `arm` from the common centre of mass.
    reduced = mass * (1.0 - share)
    trace = 2.0 * mass * dot(arm, shift) + reduced * dot(shift, shift)
    for i in range(3):
        for k in range(3):
            product = mass * (arm[i] * shift[k] + shift[i] * arm[k]) + reduced * shift[i] * shift[k]
            model.inertia[n, i, k] -= product
        model.inertia[n, i, i] += trace
        place[i] += shift[i]
        model.com[n, i] += share * shift[i]


@kernel
def _correct_joint(
    bias_filter: BiasFilter,
    torque_model: JointTorqueModel,
    motion: Motion,
    j: int,
    K: float,
    observers: Observers,
) -> None:
    """Correct bias and friction factor of joint j, and shift its observers, after `_correct_wrench`.

    Arguments as for `apply_correction`; K: 2 pi bandwidth [1/s]."""
    x, n = bias_filter.correction, torque_model.bias.shape[0]
    d_wrench, d_momentum = bias_filter.wrench_correction[0], bias_filter.wrench_correction[1]
    screw, H = motion.screw[j], motion.momentum
    bias = x[TORQUE_BIASES + j]
    torque_model.bias[j] += bias
    # Zero where friction is not estimated.
    factor = friction_factors(n) + j
    x[factor] = max(x[factor], MIN_RELATIVE_CHANGE)
    change = x[factor]
    d_torque, d_joint_momentum = bias + change * bias_filter.friction_regressor[j], 0.0
    torque_model.friction_factor[j] *= 1.0 + change
    bias_filter.friction_regressor[j] *= 1.0 + change
    if bias_filter.status[0].estimates_masses:
        for k in range(estimated_columns(bias_filter)):
            d_torque += x[masses(n) + k] * bias_filter.mass_regressor.residual[regressor_of(n, k) + j]
        for k in range(j, n):
            link_momentum = dot6(screw, of_link_alone(H, k + 1))
            d_joint_momentum += torque_model.inertia * x[masses(n) + k] * link_momentum
        d_joint_momentum += torque_model.inertia * dot6(screw, bias_filter.wrench_correction[2])
    _shift_observer(observers.joints, j, d_torque, d_joint_momentum, K)
    d_torque -= dot6(screw, d_wrench)
    d_joint_momentum -= dot6(screw, d_momentum)
    _shift_observer(observers.torque_difference, j, d_torque, d_joint_momentum, K)


@kernel
def _correct_link_sensor(
    bias_filter: BiasFilter,
    motion: Motion,
    first_body: int,
    K: float,
    observer: MomentumObserver,
    difference: MomentumObserver,
) -> None:
    """Shift the observers of a link sensor that carries links `first_body` and beyond, after
    `_correct_wrench`: of its wrench, and of its difference to the base wrench."""
    x, n = bias_filter.correction, bias_filter.torque_variance.shape[0]
    d_wrench, d_momentum = bias_filter.wrench_correction[0], bias_filter.wrench_correction[1]
    for i in range(6):
        d_link, d_link_momentum = 0.0, bias_filter.wrench_correction[2, i]
        if bias_filter.status[0].estimates_masses:
            for k in range(first_body - 1, estimated_columns(bias_filter)):
                d_link += x[masses(n) + k] * bias_filter.mass_regressor.residual[regressor_of(n, k) + n + i]
            for k in range(first_body - 1, n):
                d_link_momentum += x[masses(n) + k] * of_link_alone(motion.momentum, k + 1)[i]
        _shift_observer(observer, i, d_link, d_link_momentum, K)
        _shift_observer(difference, i, d_link - d_wrench[i], d_link_momentum - d_momentum[i], K)


@kernel
def _correct_base(
    bias_filter: BiasFilter, motion: Motion, body: int, K: float, observer: MomentumObserver
) -> None:
    """Shift the observer of the base wrench in the frame of a body, after `_correct_wrench`."""
    d_wrench, d_momentum = bias_filter.wrench_correction[0], bias_filter.wrench_correction[1]
    R, o = motion.rotation[body], motion.origin[body]
    for i in range(3):
        d_force, d_moment = 0.0, 0.0
        d_linear, d_angular = 0.0, 0.0
        for k in range(3):
            a, b = (k + 1) % 3, (k + 2) % 3
            d_force += R[k, i] * d_wrench[k]
            d_moment += R[k, i] * (d_wrench[3 + k] - o[a] * d_wrench[b] + o[b] * d_wrench[a])
            d_linear += R[k, i] * d_momentum[k]
            d_angular += R[k, i] * (d_momentum[3 + k] - o[a] * d_momentum[b] + o[b] * d_momentum[a])
        _shift_observer(observer, 6 * body + i, d_force, d_linear, K)
        _shift_observer(observer, 6 * body + 3 + i, d_moment, d_angular, K)


@kernel
def _correct_mass_regressor(bias_filter: BiasFilter) -> None:
    """Shift the observers of the regressor to the corrected model: its columns are proportional to the
    masses, and that of the last link's mass contains the moment of the payload at its place."""
    n, x = bias_filter.torque_variance.shape[0], bias_filter.correction
    if bias_filter.status[0].payload_mass > 0.0:
        for c in range(3):
            _add_to_column(bias_filter, n - 1, x[payload_place(n) + c], n + c)
            _add_to_column(bias_filter, n + c, x[masses(n) + n - 1], n + c)
    for k in range(n):
        _add_to_column(bias_filter, k, x[masses(n) + k], k)


@kernel
def _add_to_column(bias_filter: BiasFilter, k: int, factor: float, other: int) -> None:
    """Add `factor` times column `other` of the regressor to its column k."""
    n, observer = bias_filter.torque_variance.shape[0], bias_filter.mass_regressor
    offset = regressor_of(n, other) - regressor_of(n, k)
    for i in range(regressor_of(n, k), regressor_of(n, k + 1)):
        observer.residual[i] += factor * observer.residual[i + offset]
        observer.momentum[i] += factor * observer.momentum[i + offset]
        for m in range(3):
            observer.integrand[m, i] += factor * observer.integrand[m, i + offset]


@kernel
def _correct_covariance(bias_filter: BiasFilter) -> None:
    """Errors of factors and masses are relative to their estimates, which are now others, and that of a
    payload's place counts with its mass. If the last link's mass is wrong, so is the moment of the payload at
    its new place, where it may be known already: then the place is wrong, too.

    Otherwise what the sensors cannot tell apart, such as a bias and a mass that has hardly turned, would be
    another sum of errors after each correction, and seem to be known soon.
    """
    P, n, x = bias_filter.covariance, bias_filter.torque_variance.shape[0], bias_filter.correction
    last, place, bare = masses(n) + n - 1, payload_place(n), bias_filter.bare_covariance
    for i in range(friction_factors(n), P.shape[0]):
        scale = 1.0 / (1.0 + x[min(i, last)])
        for k in range(P.shape[0]):
            P[i, k] *= scale
            P[k, i] *= scale
        bare[i] *= scale
    for i in range(place, place + 3):
        for k in range(P.shape[0]):
            P[i, k] -= x[i] * P[last, k]
        for k in range(P.shape[0]):
            P[k, i] -= x[i] * P[k, last]
        bare[i] -= x[i] * bare[last]


@kernel
def _shift_observer(state: MomentumObserver, i: int, residual: float, momentum: float, K: float) -> None:
    """Shift equation i to another model. As the residual changes slowly (dr/dt small), the drift changes by
    -r."""
    state.residual[i] += residual
    state.momentum[i] += momentum
    for k in range(3):
        state.integrand[k, i] += K * momentum - residual
