"""Compiled stages for one sample: kinematics, residuals, link hypotheses, candidates. No stage allocates
memory."""

import math

import numpy as np

from contactsense.isolation.link_hypotheses import SensorModel, isolate
from contactsense.kinematics.linalg.ldl import half_squared_norm, invert_spd
from contactsense.kinematics.momenta import body_momentum_and_weight, kinematics_and_momenta
from contactsense.kinematics.spatial import dot6
from contactsense.localization.ranking import locate_contacts
from contactsense.residuals.bias_filter import (
    TIME_SINCE_UPDATE,
    apply_correction,
    predict,
    update,
    update_is_due,
)
from contactsense.residuals.equations_of_motion import (
    observe_base_in_link_frames,
    observe_joints,
    observe_torque_difference,
    observe_wrench,
    observe_wrist_difference,
    wrenches_to_base_frame,
)
from contactsense.residuals.friction_at_rest import energy_beyond_static_friction
from contactsense.residuals.joint_friction import unmodelled_torque_std
from contactsense.residuals.momentum_observer import VARIANCE_RATIO
from contactsense.residuals.noise_scale import follow_noise
from contactsense.residuals.timing_error import advance_timing_error
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.kernel import inlined_kernel
from contactsense.runtime.constants import Constants
from contactsense.runtime.state import State
from contactsense.sensors.stream_state import BASE, STEP, TORQUE, TORQUE_DIFFERENCE, WRIST, WRIST_DIFFERENCE
from contactsense.tracking.contact_tracker import NONE, PHASE


@inlined_kernel
def update_tool(constants: Constants, state: State) -> None:
    """Momentum and gravity wrench of the tool, and origin of the wrist sensor."""
    last = state.motion.rotation.shape[0] - 1
    R, o = state.motion.rotation[last], state.motion.origin[last]
    body_momentum_and_weight(
        constants.tool_mass,
        constants.tool_com,
        constants.tool_inertia,
        R,
        o,
        state.motion.twist[last],
        constants.gravity,
        state.tool_momentum[0],
        state.tool_momentum[1],
    )
    s = constants.wrist_origin
    for i in range(3):
        state.wrist_origin[i] = o[i] + R[i, 0] * s[0] + R[i, 1] * s[1] + R[i, 2] * s[2]


@inlined_kernel
def update_residuals(
    constants: Constants,
    state: State,
    bandwidth: float,
) -> None:
    """Advance the observers by the newest sample of a stream; the arm may move.

    Args:
        constants, state: The scene's constants, and the state after
            `contactsense.sensors.stream_state.register_sample`. The residuals are stored in `state`.
        bandwidth: Cut-off frequency [Hz].
    """
    motion, stream = state.motion, state.stream
    model, torque_model, unbiased_wrench = state.model, state.torque_model, state.unbiased_wrench
    qd, torque, wrist_wrench, steps = stream.qd, stream.torque, stream.wrist_wrench, stream.steps
    kinematics_and_momenta(model, stream.q, qd, constants.gravity, motion)
    update_tool(constants, state)
    for i in range(6):
        unbiased_wrench[i] = stream.base_wrench[i] - state.bias_filter.bias[i]
    if steps[BASE] >= 0.0:
        observe_base_in_link_frames(motion, unbiased_wrench, steps[BASE], bandwidth, state.base_observer)
    if steps[TORQUE] >= 0.0:
        observe_joints(
            model,
            torque_model,
            motion,
            qd,
            torque,
            steps[TORQUE],
            bandwidth,
            state.joint_observer,
            state.unmodelled_std,
        )
    if steps[WRIST] >= 0.0:
        observe_wrench(
            state.tool_momentum[0],
            state.tool_momentum[1],
            wrist_wrench,
            steps[WRIST],
            bandwidth,
            state.wrist_observer,
        )
    if steps[TORQUE_DIFFERENCE] >= 0.0:
        observe_torque_difference(
            model,
            torque_model,
            motion,
            qd,
            torque,
            unbiased_wrench,
            steps[TORQUE_DIFFERENCE],
            bandwidth,
            state.torque_difference,
        )
    if steps[WRIST_DIFFERENCE] >= 0.0:
        observe_wrist_difference(
            motion,
            state.tool_momentum,
            wrist_wrench,
            unbiased_wrench,
            steps[WRIST_DIFFERENCE],
            bandwidth,
            state.wrist_difference,
        )
    predict(
        state.bias_filter,
        torque_model,
        motion,
        constants.sensors.base_covariance,
        constants.sensors.torque_variance,
        constants.bias_rate,
        stream.scalars[STEP],
        bandwidth,
    )
    set_external(
        state,
        state.base_observer.residual,
        state.torque_difference.residual,
        state.joint_observer.residual,
        state.wrist_difference.residual,
        state.wrist_observer.residual,
    )


@inlined_kernel
def follow_noise_and_timing(constants: Constants, state: State, bandwidth: float) -> None:
    """Update what the newest sample tells of the sensors' noise, and the error due to its instant.

    Args:
        constants, state: After the observers were advanced by this sample.
        bandwidth: Cut-off frequency of the observers [Hz].
    """
    noise_scale, stream = state.noise_scale, state.stream
    follow_noise(
        noise_scale,
        BASE,
        noise_scale.base_readings,
        stream.base_wrench,
        noise_scale.base_variance,
        stream.steps[BASE],
    )
    follow_noise(
        noise_scale,
        TORQUE,
        noise_scale.torque_readings,
        stream.torque,
        constants.sensors.torque_variance,
        stream.steps[TORQUE],
    )
    advance_timing_error(state.timing_error, state.joint_observer.momentum, stream.steps[TORQUE], bandwidth)


@inlined_kernel
def set_external(
    state: State,
    base_residual: np.ndarray,
    torque_difference: np.ndarray,
    joint_residual: np.ndarray,
    wrist_difference: np.ndarray,
    wrist_residual: np.ndarray,
) -> None:
    """Store residuals, those of the observers or their window means, in `state` for the link hypotheses.

    Args:
        state: With the poses of this sample; its residual fields are filled.
        base_residual, torque_difference, joint_residual, wrist_difference, wrist_residual: Residuals in the
            order of `State`'s observers.
    """
    has_torque_difference = state.stream.usable[TORQUE_DIFFERENCE] > 0.0
    has_wrist_difference = state.stream.usable[WRIST_DIFFERENCE] > 0.0
    wrenches_to_base_frame(state.motion, base_residual, state.body_wrench)
    copy(state.body_wrench[0], state.base_wrench)
    copy(joint_residual, state.torque)
    copy(wrist_residual, state.wrist_wrench)
    for j in range(joint_residual.shape[0]):
        state.proximal_torque[j] = (
            dot6(state.motion.screw[j], state.base_wrench) + torque_difference[j]
            if has_torque_difference
            else joint_residual[j]
        )
    for i in range(6):
        state.proximal_wrist_wrench[i] = (
            state.base_wrench[i] + wrist_difference[i] if has_wrist_difference else wrist_residual[i]
        )


@inlined_kernel
def residual_variance_ratio(state: State, usable: tuple[bool, bool, bool]) -> float:
    """Variance of the observers' residuals over that of one sample's noise: the largest of the usable
    sensors. A sensor that has missed a sample has a larger ratio."""
    variance_ratio = 0.0
    if usable[0]:
        variance_ratio = max(variance_ratio, state.base_observer.scalars[VARIANCE_RATIO])
    if usable[1]:
        variance_ratio = max(variance_ratio, state.joint_observer.scalars[VARIANCE_RATIO])
    if usable[2]:
        variance_ratio = max(variance_ratio, state.wrist_observer.scalars[VARIANCE_RATIO])
    return variance_ratio


@inlined_kernel
def energy_without_contact(
    constants: Constants,
    state: State,
    has_base: bool,
    has_torque: bool,
    has_wrist: bool,
    variance_ratio: float,
) -> float:
    """Energy of the no-contact hypothesis: half the squared residuals in units of their variance.

    Arguments as for `explain`.
    """
    _fill_covariances(constants, state, variance_ratio)
    energy = 0.0
    if has_torque:
        for j in range(state.torque.shape[0]):
            energy += 0.5 * state.torque[j] ** 2 / state.torque_variance[j]
    if has_base:
        energy += half_squared_norm(state.base_covariance, state.base_wrench) / variance_ratio
    if has_wrist:
        s, w = state.wrist_origin, state.wrist_wrench
        force, moment = (
            constants.sensors.wrist_variance[0] * variance_ratio,
            constants.sensors.wrist_variance[1] * variance_ratio,
        )
        energy += 0.5 * (w[0] ** 2 + w[1] ** 2 + w[2] ** 2) / force
        energy += (
            0.5
            * (
                (w[3] - s[1] * w[2] + s[2] * w[1]) ** 2
                + (w[4] - s[2] * w[0] + s[0] * w[2]) ** 2
                + (w[5] - s[0] * w[1] + s[1] * w[0]) ** 2
            )
            / moment
        )
    return energy


@inlined_kernel
def update_covariances(constants: Constants, state: State, variance_ratio: float) -> None:
    """Fill the covariances of the residuals, noise times `variance_ratio` plus model uncertainty, and the
    inverse of that of the base wrench."""
    _fill_covariances(constants, state, variance_ratio)
    bias_filter_trace = 0.0
    for i in range(6):
        bias_filter_trace += state.bias_filter.base_covariance[i, i]
    # Zero trace and noise as stated: the precomputed inverse holds.
    if bias_filter_trace > 0.0 or state.noise_scale.scale[BASE] > 1.0:
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
    inverse_ratio, noise_scale = 1.0 / variance_ratio, state.noise_scale.scale[BASE]
    for i in range(6):
        for k in range(6):
            state.base_covariance[i, k] = (
                noise_scale * sensors.base_covariance[i, k]
                + bias_filter.base_covariance[i, k] * inverse_ratio
            )


@inlined_kernel
def _torque_noise(constants: Constants, state: State, j: int, variance_ratio: float) -> float:
    """Variance of the residual of joint j from noise, model error and the instants of the samples [Nm^2]."""
    noise = constants.sensors.torque_variance[j] * state.noise_scale.scale[TORQUE]
    return float(noise * variance_ratio + state.unmodelled_std[j] ** 2 + state.timing_error.variance[j])


@inlined_kernel
def energy_at_rest(
    constants: Constants,
    state: State,
    variance_ratio: float,
    thresholds: tuple[float, float],
    bandwidth: float,
) -> float:
    """Energy of the no-contact hypothesis from the change of the torques since the arm came to rest
    (`contactsense.residuals.friction_at_rest`).

    Args:
        constants, state: After `update_residuals` for this sample.
        variance_ratio, thresholds, bandwidth: As for `energy_beyond_static_friction`.
    """
    energy: float = energy_beyond_static_friction(
        state.friction_at_rest,
        state.torque_model,
        state.stream.q,
        state.torque,
        constants.sensors.torque_variance,
        variance_ratio * state.noise_scale.scale[TORQUE],
        state.bias_filter.torque_variance,
        state.stream.steps[TORQUE],
        state.track.scalars[PHASE] != NONE,
        thresholds,
        bandwidth,
    )
    return energy


@inlined_kernel
def update_bias_filter(
    constants: Constants,
    state: State,
    has_base: bool,
    has_torque: bool,
    variance_ratio: float,
    bandwidth: float,
) -> None:
    """Update sensor biases and link masses from the residuals in free motion.

    Residuals are an Ornstein-Uhlenbeck process. Samples of it taken some time apart are correlated; the
    variance is inflated accordingly.

    Args:
        constants, state: After `update_residuals` and `energy_without_contact` for this sample.
        has_base, has_torque: Which residuals can be used.
        variance_ratio: Variance of the residuals over that of one sample's noise.
        bandwidth: Cut-off frequency of the observers [Hz].
    """
    bias_filter, n = state.bias_filter, state.torque.shape[0]
    if not update_is_due(bias_filter, bandwidth):
        return
    K = 2.0 * math.pi * bandwidth
    correlation = math.exp(-K * bias_filter.scalars[TIME_SINCE_UPDATE])
    variance_inflation = (1.0 + correlation) / (1.0 - correlation)
    bias_filter.scalars[TIME_SINCE_UPDATE] = 0.0
    if has_torque:
        for j in range(n):
            variance = _torque_noise(constants, state, j, variance_ratio)
            update(bias_filter, j, n, state.joint_observer.residual[j], variance * variance_inflation)
    if has_base:
        for i in range(6):
            variance = (
                constants.sensors.base_covariance[i, i] * state.noise_scale.scale[BASE] * variance_ratio
            )
            update(bias_filter, n + i, n, state.base_wrench[i], variance * variance_inflation)
    apply_correction(
        bias_filter,
        state.model,
        state.torque_model,
        state.motion,
        bandwidth,
        state.base_observer,
        state.torque_difference,
        state.joint_observer,
        state.wrist_difference,
    )
    for j in range(n):
        for k in range(state.friction_at_rest.mean_residual.shape[0]):
            state.friction_at_rest.mean_residual[k, j] += state.joint_observer.residual[j] - state.torque[j]


@inlined_kernel
def take_static_sample(
    constants: Constants,
    state: State,
    q: np.ndarray,
    torque: np.ndarray,
    base_wrench: np.ndarray,
    wrist_wrench: np.ndarray,
    external: bool,
) -> None:
    """Fill `state` from one sample of an arm at rest: poses and residuals.

    With `external` the arm's weight has been subtracted from the measurements already; joint torques keep the
    actuator's sign, so that a contact wrench w adds -s_j . w to them.
    """
    motion = state.motion
    kinematics_and_momenta(constants.model, q, state.zero_velocity, constants.gravity, motion)
    update_tool(constants, state)
    for j in range(q.shape[0]):
        model_torque = constants.torque_model.bias[j] - constants.torque_model.gravity * dot6(
            motion.screw[j], motion.gravity[j + 1]
        )
        state.torque[j] = (0.0 if external else model_torque) - torque[j]
        state.unmodelled_std[j] = unmodelled_torque_std(constants.torque_model, j, 0.0, 0.0)
    for i in range(6):
        state.base_wrench[i] = base_wrench[i] - (0.0 if external else motion.gravity[0, i])
        state.wrist_wrench[i] = wrist_wrench[i] - (0.0 if external else state.tool_momentum[1, i])
    state.bias_filter.base_covariance[:] = 0.0
    state.bias_filter.torque_variance[:] = 0.0
    state.timing_error.variance[:] = 0.0
    state.noise_scale.scale[:] = 1.0
    for body in range(state.body_wrench.shape[0]):
        copy(state.base_wrench, state.body_wrench[body])
    copy(state.torque, state.proximal_torque)
    copy(state.wrist_wrench, state.proximal_wrist_wrench)


@inlined_kernel
def explain(
    constants: Constants,
    state: State,
    has_base: bool,
    has_torque: bool,
    has_wrist: bool,
    variance_ratio: float,
    gate: bool,
    threshold: float,
) -> tuple[int, float]:
    """Explain the residuals in `state` by one contact.

    Args:
        constants: The scene's constants.
        state: With poses and residuals; the result is stored in `candidates` and `link_probability`.
        has_base, has_torque, has_wrist: Which sensors have a value.
        variance_ratio: Variance of the residuals over that of one sample's noise.
        gate: Choose the link of highest evidence first and search on that link only.
        threshold: No candidates are computed if the energy of the no-contact hypothesis is not above this.

    Returns:
        Number of candidates, and the energy of the no-contact hypothesis: half the squared residuals in units
        of the noise.
    """
    update_covariances(constants, state, variance_ratio)
    sensors = constants.sensors
    isolate(
        SensorModel(
            sensors.depth,
            sensors.beyond_wrist,
            state.base_covariance,
            state.base_information,
            sensors.torque_variance,
            sensors.wrist_variance,
        ),
        state.motion.screw,
        state.base_wrench,
        has_base,
        state.torque,
        state.proximal_torque,
        state.torque_variance,
        has_torque,
        state.wrist_wrench,
        state.proximal_wrist_wrench,
        has_wrist,
        state.wrist_origin,
        variance_ratio,
        state.hypotheses,
    )
    # A contact on the base link loads the base sensor only: the joints' part of its energy is that of no
    # contact.
    no_contact_energy = state.hypotheses.energy[0]
    if has_base:
        for i in range(6):
            row = dot6(state.base_information[i], state.base_wrench)
            no_contact_energy += 0.5 * state.base_wrench[i] * row / variance_ratio
        for link in range(1, constants.touchable.shape[0]):
            for i in range(6):
                state.hypotheses.wrench[link, i] += (
                    state.body_wrench[constants.sensors.depth[link], i] - state.base_wrench[i]
                )
    if no_contact_energy <= threshold:
        return 0, no_contact_energy
    best = -1
    for link in range(constants.touchable.shape[0]):
        state.candidate_links[link] = 0 if gate else constants.touchable[link]
        if constants.touchable[link] and (
            best < 0 or state.hypotheses.log_evidence[link] > state.hypotheses.log_evidence[best]
        ):
            best = link
    if best >= 0:
        state.candidate_links[best] = 1
    count = locate_contacts(
        constants.surfaces,
        constants.samples,
        constants.subsamples,
        state.candidate_links,
        constants.sensors.depth,
        state.motion,
        state.hypotheses,
        has_base,
        constants.prior,
        state.search_buffers,
        state.surface_cells,
        state.candidates,
        state.link_probability,
    )
    return count, no_contact_energy
