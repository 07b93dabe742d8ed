"""Correct the model by what the filter of `contactsense.residuals.bias_filter` has learned, without a jump of
the residuals."""

import math

import numpy as np

from contactsense.kinematics.model import Model, Motion
from contactsense.kinematics.spatial import dot6
from contactsense.residuals.bias_filter import BiasFilter
from contactsense.residuals.joint_friction import JointTorqueModel
from contactsense.residuals.momentum_observer import MomentumObserver, group_of
from contactsense.residuals.observers import Observers
from contactsense.robots.jit.kernel import kernel

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
    """Apply `correction` to biases, friction and masses, and shift the observers to the state that they would
    have had with the corrected model.

    Args:
        bias_filter: With `correction`, which is reset to zero.
        model, torque_model: Masses, torque biases and friction factors, changed in place.
        motion: Of this sample.
        bandwidth: Cut-off frequency of the observers [Hz].
        observers: Changed in place.
        first_body: First link that each link sensor carries, shape (S,), int64.
    """
    x, n = bias_filter.correction, torque_model.bias.shape[0]
    m, first = n + 6, 2 * n + 6
    K = 2.0 * math.pi * bandwidth
    d_wrench, d_momentum = bias_filter.wrench_correction[0], bias_filter.wrench_correction[1]
    for i in range(6):
        bias_filter.bias[i] += x[i]
        d_wrench[i], d_momentum[i] = -x[i], 0.0
    estimates_masses = bias_filter.status[0].estimates_masses
    regressor, H = bias_filter.mass_regressor.residual, motion.momentum
    if estimates_masses:
        for k in range(n):
            x[first + k] = max(x[first + k], MIN_RELATIVE_CHANGE)
            model.mass[k + 1] *= 1.0 + x[first + k]
            for i in range(3):
                for j in range(3):
                    model.inertia[k + 1, i, j] *= 1.0 + x[first + k]
            for i in range(6):
                d_wrench[i] += x[first + k] * regressor[m * k + n + i]
                d_momentum[i] += x[first + k] * (H[k + 1, i] - (H[k + 2, i] if k + 2 <= n else 0.0))
    for j in range(n):
        torque_model.bias[j] += x[6 + j]
        # Zero where friction is not estimated.
        change = max(x[6 + n + j], MIN_RELATIVE_CHANGE)
        d_torque, d_joint_momentum = x[6 + j] + change * bias_filter.friction_regressor[j], 0.0
        torque_model.friction_factor[j] *= 1.0 + change
        bias_filter.friction_regressor[j] *= 1.0 + change
        if estimates_masses:
            for k in range(n):
                d_torque += x[first + k] * regressor[m * k + j]
            for k in range(j, n):
                link_momentum = dot6(motion.screw[j], H[k + 1])
                link_momentum -= dot6(motion.screw[j], H[k + 2]) if k + 2 <= n else 0.0
                d_joint_momentum += torque_model.inertia * x[first + k] * link_momentum
        _shift_observer(observers.joints, j, d_torque, d_joint_momentum, K)
        _shift_observer(
            observers.torque_difference,
            j,
            d_torque - dot6(motion.screw[j], d_wrench),
            d_joint_momentum - dot6(motion.screw[j], d_momentum),
            K,
        )
    for s in range(first_body.shape[0]):
        for i in range(6):
            d_link, d_link_momentum = 0.0, 0.0
            if estimates_masses:
                for k in range(first_body[s] - 1, n):
                    d_link += x[first + k] * regressor[m * k + n + i]
                    d_link_momentum += x[first + k] * (H[k + 1, i] - (H[k + 2, i] if k + 2 <= n else 0.0))
            _shift_observer(group_of(observers.links, s), i, d_link, d_link_momentum, K)
            _shift_observer(
                group_of(observers.link_difference, s),
                i,
                d_link - d_wrench[i],
                d_link_momentum - d_momentum[i],
                K,
            )
    for body in range(n + 1):
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
            _shift_observer(observers.base, 6 * body + i, d_force, d_linear, K)
            _shift_observer(observers.base, 6 * body + 3 + i, d_moment, d_angular, K)
    x[:] = 0.0


@kernel
def _shift_observer(state: MomentumObserver, i: int, residual: float, momentum: float, K: float) -> None:
    """Shift equation i to another model. As the residual changes slowly (dr/dt small), the drift changes by
    -r."""
    state.residual[i] += residual
    state.momentum[i] += momentum
    for k in range(3):
        state.integrand[k, i] += K * momentum - residual
