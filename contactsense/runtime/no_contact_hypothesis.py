"""The hypothesis that nothing touches: its energy, the covariances of the residuals, and the update of biases
and masses while it holds."""

import math

import numpy as np

from contactsense.kinematics.decorrelation import decorrelate
from contactsense.kinematics.linalg.ldl import half_squared_norm, invert_spd
from contactsense.kinematics.spatial import component_about, dot6
from contactsense.residuals.bias_filter import update_is_due
from contactsense.residuals.bias_update import update_by_torque, update_by_wrench
from contactsense.residuals.friction_at_rest import TorqueVariance, energy_beyond_static_friction
from contactsense.residuals.model_correction import apply_correction
from contactsense.residuals.observers import parts_of
from contactsense.residuals.residual_ewma import share_in_average
from contactsense.residuals.wrench_velocity_error import noise_share_in_average, of_link_sensor
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.kernel import inlined_kernel
from contactsense.runtime.state import State
from contactsense.scene_model.constants import Constants
from contactsense.sensors.stream_state import BASE, TORQUE
from contactsense.tracking.contact_track import NONE

MIN_VARIANCE_RATIO = 1e-9
"""Least variance of the residuals over that of a sample's noise; it is 0 before the first sample."""


@inlined_kernel
def energy_without_contact(
    constants: Constants,
    state: State,
    has_base: bool,
    has_torque: bool,
    link_sensors: int,
    variance_ratio: float,
) -> float:
    """Energy of the no-contact hypothesis: half the squared residuals in units of their variance.

    Arguments as for `contactsense.runtime.explanation.explain_sample`.
    """
    _fill_covariances(constants, state, variance_ratio)
    energy = _energy_of(state, state.torque, state.link_wrench, has_torque, link_sensors)
    if has_base:
        energy += half_squared_norm(state.base_covariance, state.base_wrench) / variance_ratio
    return float(energy)


@inlined_kernel
def energy_of_ewma(constants: Constants, state: State, has_torque: bool, link_sensors: int) -> float:
    """Energy of the no-contact hypothesis from the average of the residuals, where it is tested. It fills the
    covariances of `energy_without_contact`, which comes after it.

    Model errors of the torques count as far as they last as long as the average does. Arguments as for
    `energy_without_contact`.
    """
    n, count = state.torque.shape[0], state.link_wrench.shape[0]
    _fill_covariances(constants, state, state.ewma.status[0].variance_ratio)
    mean = parts_of(state.ewma.mean, n, count)
    return float(_energy_of(state, mean.torque, mean.link_wrench, has_torque, link_sensors))


@inlined_kernel
def _energy_of(
    state: State, torque: np.ndarray, link_wrench: np.ndarray, has_torque: bool, link_sensors: int
) -> float:
    """Half the squared residuals of joint torques, shape (n,) [Nm], and link sensors, shape (S, 6) [N, Nm],
    in units of the variances in `state`."""
    energy = 0.0
    if has_torque:
        for j in range(torque.shape[0]):
            energy += 0.5 * torque[j] ** 2 / state.torque_variance[j]
    for s in range(link_wrench.shape[0]):
        if link_sensors >> s & 1:
            for i in range(6):
                energy += 0.5 * dot6(state.link_row[s, i], link_wrench[s]) ** 2 / state.link_variance[s, i]
    return energy


@inlined_kernel
def energy_of_change(
    constants: Constants, state: State, has_torque: bool, link_sensors: int, variance_ratio: float
) -> float:
    """Energy of the hypothesis that the newest residual has the mean of the residuals' average: that a
    contact goes on. Arguments as for `energy_without_contact`, without a base sensor."""
    n, count, energy = state.torque.shape[0], state.link_wrench.shape[0], 0.0
    average = state.ewma.status[0]
    variance_ratio += average.variance_ratio - 2.0 * average.residual_covariance
    mean = parts_of(state.ewma.mean, n, count)
    if has_torque:
        for j in range(n):
            noise = constants.sensors.torque_variance[j] * state.noise_scale.noise[TORQUE].scale
            energy += 0.5 * (state.torque[j] - mean.torque[j]) ** 2 / (noise * variance_ratio)
    for s in range(count):
        if link_sensors >> s & 1:
            for i in range(6):
                row = component_about(state.link_origin[s], i)
                noise = constants.sensors.link_variance[s, i // 3]
                change = dot6(row, state.link_wrench[s]) - dot6(row, mean.link_wrench[s])
                energy += 0.5 * change**2 / (noise * variance_ratio)
    return energy


@inlined_kernel
def update_covariances(constants: Constants, state: State, variance_ratio: float) -> None:
    """Fill the covariances of the residuals, noise times `variance_ratio` plus model uncertainty, and the
    inverse of that of the base wrench."""
    _fill_covariances(constants, state, variance_ratio)
    trace = 0.0
    for i in range(6):
        trace += state.bias_filter.base_covariance[i, i]
        trace += state.base_velocity_error.noise[i, i] + state.base_velocity_error.instants[i, i]
    # Noise alone, as stated: the precomputed inverse holds.
    if trace > 0.0 or state.noise_scale.noise[BASE].scale > 1.0:
        invert_spd(state.base_covariance, state.base_information)
    else:
        for i in range(6):
            copy(constants.sensors.base_information[i], state.base_information[i])


@inlined_kernel
def _fill_covariances(constants: Constants, state: State, variance_ratio: float) -> None:
    sensors, bias_filter = constants.sensors, state.bias_filter
    for j in range(state.torque.shape[0]):
        state.torque_variance[j] = (
            _torque_noise(constants, state, j, variance_ratio) + bias_filter.torque_variance[j]
        )
    # In an average the errors due to the instants, which decay as the residual does, have the share of
    # low-passed noise.
    residual_ratio = _residual_ratio(state)
    share = variance_ratio / residual_ratio
    noise_share = noise_share_in_average(min(share, 1.0), constants.bandwidth)
    for s in range(state.link_variance.shape[0]):
        error, model = of_link_sensor(state.link_velocity_error, s), state.link_model_covariance[s]
        for i in range(6):
            for k in range(6):
                velocities = noise_share * error.noise[i, k] + share * error.instants[i, k]
                model[i, k] = state.link_mass_covariance[s, i, k] + velocities
        of_force, of_moment = sensors.link_variance[s, 0], sensors.link_variance[s, 1]
        noise_variance = (of_force * variance_ratio, of_moment * variance_ratio)
        decorrelate(state.link_origin[s], noise_variance, model, state.link_row[s], state.link_variance[s])
    inverse_ratio, inverse_residual_ratio = 1.0 / variance_ratio, 1.0 / residual_ratio
    noise_scale, error = state.noise_scale.noise[BASE].scale, state.base_velocity_error
    for i in range(6):
        for k in range(6):
            noise = (
                noise_scale * sensors.base_covariance[i, k] + error.instants[i, k] * inverse_residual_ratio
            )
            state.base_noise[i, k] = noise + error.noise[i, k] * inverse_residual_ratio
            noise += noise_share * error.noise[i, k] * inverse_ratio
            state.base_covariance[i, k] = noise + bias_filter.base_covariance[i, k] * inverse_ratio


@inlined_kernel
def _residual_ratio(state: State) -> float:
    """Variance of the newest residuals over that of a sample's noise."""
    return float(max(state.stream.clock[0].variance_ratio, MIN_VARIANCE_RATIO))


@inlined_kernel
def _torque_noise(constants: Constants, state: State, j: int, variance_ratio: float) -> float:
    """Variance of the residual of joint j, or of an average of it, from noise, model error and the instants
    of the samples [Nm^2]."""
    noise = constants.sensors.torque_variance[j] * state.noise_scale.noise[TORQUE].scale
    inertia_torque = state.inertia_torque.present[j]
    model_variance = (
        state.unmodelled_std[j] ** 2
        + constants.torque_model.inertia_torque_variance[j] * inertia_torque * inertia_torque
    )
    share = share_in_average(
        constants.torque_model.average_variance[j], variance_ratio / _residual_ratio(state)
    )
    return float(noise * variance_ratio + state.timing_error.variance[j] + share * model_variance)


@inlined_kernel
def energy_at_rest(
    constants: Constants,
    state: State,
    variance_ratio: float,
    thresholds: tuple[float, float],
) -> float:
    """Energy of the no-contact hypothesis from the change of the torques since the arm came to rest
    (`contactsense.residuals.friction_at_rest`).

    Args:
        constants, state: After `update_residuals` for this sample.
        variance_ratio, thresholds: As for `energy_beyond_static_friction`.
    """
    energy: float = energy_beyond_static_friction(
        state.friction_at_rest,
        state.torque_model,
        state.stream.q,
        state.torque,
        TorqueVariance(
            constants.sensors.torque_variance,
            variance_ratio * state.noise_scale.noise[TORQUE].scale,
            state.bias_filter.torque_variance,
        ),
        state.stream.steps[TORQUE],
        state.track.status[0].phase != NONE,
        thresholds,
        constants.bandwidth,
    )
    return energy


@inlined_kernel
def update_bias_filter(
    constants: Constants,
    state: State,
    has_base: bool,
    has_torque: bool,
    variance_ratio: float,
) -> None:
    """Update sensor biases and link masses from the residuals in free motion.

    Residuals are an Ornstein-Uhlenbeck process. Samples of it taken some time apart are correlated; the
    variance is inflated accordingly.

    Args:
        constants, state: After `update_residuals` and `energy_without_contact` for this sample.
        has_base, has_torque: Which residuals can be used.
        variance_ratio: Variance of the residuals over that of one sample's noise.
    """
    bias_filter, n, bandwidth = state.bias_filter, state.torque.shape[0], constants.bandwidth
    if not update_is_due(bias_filter, bandwidth):
        return
    K = 2.0 * math.pi * bandwidth
    correlation = math.exp(-K * bias_filter.status[0].time_since_update)
    variance_inflation = (1.0 + correlation) / (1.0 - correlation)
    bias_filter.status[0].time_since_update = 0.0
    if has_torque:
        for j in range(n):
            variance = _torque_noise(constants, state, j, variance_ratio)
            update_by_torque(
                bias_filter, j, state.observers.joints.residual[j], variance * variance_inflation
            )
    if has_base:
        update_by_wrench(
            bias_filter, state.base_wrench, state.base_noise, variance_ratio * variance_inflation
        )
    apply_correction(
        bias_filter,
        state.model,
        state.torque_model,
        state.motion,
        bandwidth,
        state.observers,
        constants.link_sensors.first_body,
    )
    _correct_memory(state)


@inlined_kernel
def _correct_memory(state: State) -> None:
    """Shift what is remembered of residuals and momenta as a correction has just shifted those of the
    observers, so that the next sample finds no change."""
    n, count = state.torque.shape[0], state.link_wrench.shape[0]
    average = parts_of(state.ewma.mean, n, count)
    for j in range(n):
        change = state.observers.joints.residual[j] - state.torque[j]
        average.torque[j] += change
        for k in range(state.friction_at_rest.mean_residual.shape[0]):
            state.friction_at_rest.mean_residual[k, j] += change
    for s in range(count):
        for i in range(6):
            average.link_wrench[s, i] += state.observers.links.residual[s, i] - state.link_wrench[s, i]
    copy(state.observers.joints.momentum, state.timing_error.momentum)
