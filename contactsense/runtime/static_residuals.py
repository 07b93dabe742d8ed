"""Residuals of an arm at rest, from one measurement without a stream."""

from typing import TypeAlias

import numpy as np

from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.kinematics.spatial import add_outer, dot6
from contactsense.residuals.joint_friction import unmodelled_torque_std
from contactsense.residuals.mass_error import add_mass_covariance, mass_torque_variance
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.kernel import inlined_kernel
from contactsense.runtime.residual_update import update_link_sensors
from contactsense.runtime.state import State
from contactsense.scene_model.constants import Constants

Measured: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Joint positions [rad] and torques [Nm], shape (n,), base wrench (6,) and wrenches on the link sensors (S,
6) [N, Nm]; any values for sensors that have not measured. A plain tuple: Numba takes longer to recognize a
named one."""


@inlined_kernel
def take_static_sample(
    constants: Constants,
    state: State,
    measured: Measured,
    external: bool,
) -> None:
    """Fill `state` from one sample of an arm at rest: poses and `take_static_residuals`."""
    q = measured[0]
    kinematics_and_momenta(constants.model, q, state.zero_velocity, constants.gravity, state.motion)
    take_static_residuals(constants, state, measured, external)


@inlined_kernel
def take_static_residuals(
    constants: Constants,
    state: State,
    measured: Measured,
    external: bool,
) -> None:
    """Fill `state` with the residuals of one sample of an arm at rest, whose poses it has.

    With `external` the arm's weight has been subtracted from the measurements already; joint torques keep the
    actuator's sign, so that a contact wrench w adds -s_j . w to them.
    """
    motion = state.motion
    q, torque, base_wrench, link_wrench = measured
    update_link_sensors(constants, state)
    for j in range(q.shape[0]):
        model_torque = constants.torque_model.bias[j] - constants.torque_model.gravity * dot6(
            motion.screw[j], motion.gravity[j + 1]
        )
        state.torque[j] = (0.0 if external else model_torque) - torque[j]
        state.unmodelled_std[j] = unmodelled_torque_std(constants.torque_model, j, 0.0)
    for i in range(6):
        state.base_wrench[i] = base_wrench[i] - (0.0 if external else motion.gravity[0, i])
    _set_model_errors(constants, state, external)
    state.timing_error.variance[:] = 0.0
    state.base_velocity_error.noise[:] = 0.0
    state.base_velocity_error.instants[:] = 0.0
    state.link_velocity_error.noise[:] = 0.0
    state.link_velocity_error.instants[:] = 0.0
    state.inertia_torque.present[:] = 0.0
    for i in range(len(state.noise_scale.noise)):
        state.noise_scale.noise[i].scale = 1.0
    for body in range(state.body_wrench.shape[0]):
        copy(state.base_wrench, state.body_wrench[body])
    copy(state.torque, state.proximal_torque)
    for s in range(link_wrench.shape[0]):
        for i in range(6):
            state.link_wrench[s, i] = link_wrench[s, i] - (0.0 if external else state.link_load[s, 1, i])
            state.proximal_link_wrench[s, i] = state.link_wrench[s, i]


@inlined_kernel
def _set_model_errors(constants: Constants, state: State, external: bool) -> None:
    """Covariances because of the masses, if their weight is subtracted here; a single measurement has no
    biases and friction factors that were learnt."""
    base_covariance, torque_variance = state.bias_filter.base_covariance, state.bias_filter.torque_variance
    base_covariance[:] = 0.0
    torque_variance[:] = 0.0
    state.link_mass_covariance[:] = 0.0
    error, weight = constants.inertia_error, state.motion.gravity
    if external or error == 0.0:
        return
    add_mass_covariance(weight, error, 0, base_covariance)
    error_of_torque = constants.torque_model.gravity * error
    for j in range(torque_variance.shape[0]):
        torque_variance[j] = mass_torque_variance(weight, error_of_torque, state.motion.screw[j], j)
    for s in range(state.link_mass_covariance.shape[0]):
        first = constants.link_sensors.first_body[s]
        add_mass_covariance(weight, error, first, state.link_mass_covariance[s])
        if first == weight.shape[0]:
            add_outer(state.link_mass_covariance[s], state.link_load[s, 1], error * error)
