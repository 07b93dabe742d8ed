"""Residuals of one sample of a stream: kinematics, observers, noise. Nothing allocates memory."""

from contactsense.kinematics.composite_inertia import unit_momenta, unit_momenta_of_arm
from contactsense.kinematics.momenta import body_momentum_and_weight, kinematics_and_momenta
from contactsense.kinematics.spatial import add_outer, dot6
from contactsense.residuals.bias_filter import mass_covariance, predict
from contactsense.residuals.equations_of_motion import (
    advance_base,
    advance_torques,
    observe_wrench,
    observe_wrench_difference,
    wrenches_to_base_frame,
)
from contactsense.residuals.inertia_torque import follow_inertia_torque
from contactsense.residuals.momentum_observer import advance, group_of, start_step
from contactsense.residuals.noise_scale import follow_noise
from contactsense.residuals.observers import ResidualParts, start_steps
from contactsense.residuals.timing_error import advance_timing_error
from contactsense.residuals.velocity_noise import follow_velocity_noise
from contactsense.residuals.wrench_velocity_error import advance_wrench_velocity_error, of_link_sensor
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.kernel import inlined_kernel
from contactsense.runtime.state import State
from contactsense.scene_model.constants import Constants
from contactsense.sensors.stream_state import BASE, LINK, TORQUE, TORQUE_DIFFERENCE


@inlined_kernel
def update_link_sensors(constants: Constants, state: State) -> None:
    """Momentum and gravity wrench of what each link sensor carries, and the sensors' origins, for the poses
    in `state`."""
    motion, sensors = state.motion, constants.link_sensors
    for s in range(sensors.body.shape[0]):
        body, first = sensors.body[s], sensors.first_body[s]
        R, o, c = motion.rotation[body], motion.origin[body], sensors.origin[s]
        load = state.link_load[s]
        body_momentum_and_weight(
            sensors.mass[s], sensors.com[s], sensors.inertia[s], R, o, motion.twist[body], constants.gravity,
            load[0], load[1],
        )  # fmt: skip
        if first < motion.momentum.shape[0]:
            for i in range(6):
                load[0, i] += motion.momentum[first, i]
                load[1, i] += motion.gravity[first, i]
        for i in range(3):
            state.link_origin[s, i] = o[i] + R[i, 0] * c[0] + R[i, 1] * c[1] + R[i, 2] * c[2]


@inlined_kernel
def observe_link_sensors(constants: Constants, state: State) -> None:
    """Advance the observers of the link sensors by the newest sample, after `update_link_sensors`."""
    stream, count, bandwidth = state.stream, state.link_load.shape[0], constants.bandwidth
    for s in range(count):
        load, wrench = state.link_load[s], stream.link_wrench[s]
        step, difference_step = stream.steps[LINK + s], stream.steps[LINK + count + s]
        if step >= 0.0:
            observe_wrench(load[0], load[1], wrench, step, bandwidth, group_of(state.observers.links, s))
        if difference_step >= 0.0:
            observe_wrench_difference(
                state.motion, load[0], load[1], wrench, state.unbiased_wrench, difference_step, bandwidth,
                group_of(state.observers.link_difference, s),
            )  # fmt: skip


@inlined_kernel
def predict_link_sensors(constants: Constants, state: State) -> None:
    """Covariance of the link sensors' residuals due to the masses, after the prediction of the bias filter
    for this sample.

    The filter knows the last link together with the tool. So the mass of the tool, where a sensor carries
    nothing else, has the error that the scene states.
    """
    if not state.bias_filter.status[0].estimates_masses:
        return
    step = start_step(state.load_regressor, state.stream.clock[0].step, constants.bandwidth)
    for s in range(state.link_load.shape[0]):
        first, covariance = constants.link_sensors.first_body[s], state.link_mass_covariance[s]
        mass_covariance(state.bias_filter, first, covariance)
        if first == state.motion.momentum.shape[0]:
            for i in range(6):
                momentum, weight = state.link_load[s, 0, i], state.link_load[s, 1, i]
                advance(state.load_regressor, 6 * s + i, momentum, weight, step)
            wrench = state.load_regressor.residual[6 * s : 6 * s + 6]
            add_outer(covariance, wrench, constants.inertia_error**2)


@inlined_kernel
def update_residuals(constants: Constants, state: State) -> None:
    """Advance the observers by the newest sample of a stream; the arm may move.

    Args:
        constants, state: The scene's constants, and the state after
            `contactsense.sensors.stream_state.register_sample`. The residuals are stored in `state`.
    """
    motion, stream, bandwidth = state.motion, state.stream, constants.bandwidth
    model, torque_model, unbiased_wrench = state.model, state.torque_model, state.unbiased_wrench
    qd, torque, steps = stream.qd, stream.torque, stream.steps
    follow_velocity_noise(state.velocity_noise, qd, stream.clock[0].step)
    kinematics_and_momenta(model, stream.q, qd, constants.gravity, motion)
    update_link_sensors(constants, state)
    for i in range(6):
        unbiased_wrench[i] = stream.base_wrench[i] - state.bias_filter.bias[i]
    of_base, of_joints, of_difference = start_steps(state.observers, steps, bandwidth)
    if steps[BASE] >= 0.0:
        advance_base(motion, unbiased_wrench, of_base, state.observers.base)
    advance_torques(
        model,
        torque_model,
        motion,
        (qd, torque, unbiased_wrench),
        (steps[TORQUE], steps[TORQUE_DIFFERENCE]),
        (of_joints, of_difference),
        state.observers,
        state.stream_unmodelled_std,
        state.bias_filter.friction_regressor,
    )
    observe_link_sensors(constants, state)
    predict(
        state.bias_filter,
        torque_model,
        motion,
        constants.sensors.base_covariance,
        constants.sensors.torque_variance,
        constants.bias_rate,
        stream.clock[0].step,
        stream.clock[0].usual_step,
        bandwidth,
    )
    predict_link_sensors(constants, state)
    set_residuals(state)


@inlined_kernel
def set_residuals(state: State) -> None:
    """Store the observers' residuals in `state`, as far as the hypothesis that nothing touches needs them."""
    # The base's own frame is the base frame.
    for i in range(6):
        state.base_wrench[i] = state.observers.base.residual[i]
    copy(state.observers.joints.residual, state.torque)
    for s in range(state.link_load.shape[0]):
        copy(state.observers.links.residual[s], state.link_wrench[s])


@inlined_kernel
def follow_noise_and_timing(constants: Constants, state: State) -> None:
    """Update what the newest sample tells of the sensors' noise, and the errors due to its instant, to the
    acceleration and to friction. A single measurement may have replaced them since the sample before.

    Args:
        constants, state: After the observers were advanced by this sample.
    """
    noise_scale, stream, bandwidth = state.noise_scale, state.stream, constants.bandwidth
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
    advance_timing_error(state.timing_error, state.observers.joints.momentum, stream.steps[TORQUE], bandwidth)
    _advance_velocity_errors(constants, state)
    follow_inertia_torque(state.inertia_torque, state.timing_error.rate, stream.steps[TORQUE], bandwidth)
    copy(state.stream_unmodelled_std, state.unmodelled_std)


@inlined_kernel
def _advance_velocity_errors(constants: Constants, state: State) -> None:
    """Errors of the wrenches due to the joint velocities; where `State.velocity_noise` says so, the poses in
    `state` are those of this sample."""
    velocities, steps, bandwidth = state.velocity_noise, state.stream.steps, constants.bandwidth
    changed = velocities.history[0].due
    base, sensors = state.base_velocity_error, constants.link_sensors
    if changed:
        unit_momenta_of_arm(state.model, state.motion, base.unit_momentum)
    advance_wrench_velocity_error(base, velocities, steps[BASE], bandwidth)
    for s in range(state.link_load.shape[0]):
        error = of_link_sensor(state.link_velocity_error, s)
        if changed:
            part = (sensors.mass[s], sensors.com[s], sensors.inertia[s])
            unit_momenta(state.model, state.motion, sensors.first_body[s], part, error.unit_momentum)
        advance_wrench_velocity_error(error, velocities, steps[LINK + s], bandwidth)


@inlined_kernel
def set_external(state: State, residuals: ResidualParts) -> None:
    """Store residuals, those of the observers or their window means, in `state` for the link hypotheses.

    Args:
        state: With the poses of this sample; its residual fields are filled.
        residuals: The residuals.
    """
    has_torque_difference = state.stream.usable[TORQUE_DIFFERENCE] > 0
    wrenches_to_base_frame(state.motion, residuals.base, state.body_wrench)
    copy(state.body_wrench[0], state.base_wrench)
    copy(residuals.torque, state.torque)
    for j in range(residuals.torque.shape[0]):
        state.proximal_torque[j] = (
            dot6(state.motion.screw[j], state.base_wrench) + residuals.torque_difference[j]
            if has_torque_difference
            else residuals.torque[j]
        )
    link_difference, link_residual = residuals.link_difference, residuals.link_wrench
    count = link_residual.shape[0]
    for s in range(count):
        has_difference = state.stream.usable[LINK + count + s] > 0
        for i in range(6):
            state.link_wrench[s, i] = link_residual[s, i]
            state.proximal_link_wrench[s, i] = (
                state.base_wrench[i] + link_difference[s, i] if has_difference else link_residual[s, i]
            )


@inlined_kernel
def residual_variance_ratio(state: State, usable: tuple[bool, bool, int]) -> float:
    """Variance of the observers' residuals over that of one sample's noise: the largest of the usable
    sensors, see `contactsense.sensors.usable_sensors.Usable`. A sensor that has missed a sample has a larger
    ratio."""
    variance_ratio = 0.0
    if usable[0]:
        variance_ratio = max(variance_ratio, state.observers.base.history[0].variance_ratio)
    if usable[1]:
        variance_ratio = max(variance_ratio, state.observers.joints.history[0].variance_ratio)
    for s in range(state.link_load.shape[0]):
        if usable[2] >> s & 1:
            variance_ratio = max(variance_ratio, group_of(state.observers.links, s).history[0].variance_ratio)
    return variance_ratio
