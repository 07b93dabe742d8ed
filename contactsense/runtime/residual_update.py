"""Residuals of one sample of a stream: kinematics, observers, noise. Nothing allocates memory."""

import numpy as np

from contactsense.kinematics.momenta import body_momentum_and_weight, kinematics_and_momenta
from contactsense.kinematics.spatial import dot6
from contactsense.residuals.bias_filter import (
    predict,
)
from contactsense.residuals.equations_of_motion import (
    observe_base_in_link_frames,
    observe_joints,
    observe_torque_difference,
    observe_wrench,
    observe_wrist_difference,
    wrenches_to_base_frame,
)
from contactsense.residuals.momentum_observer import VARIANCE_RATIO
from contactsense.residuals.noise_scale import follow_noise
from contactsense.residuals.timing_error import advance_timing_error
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.kernel import inlined_kernel
from contactsense.runtime.constants import Constants
from contactsense.runtime.state import State
from contactsense.sensors.stream_state import BASE, STEP, TORQUE, TORQUE_DIFFERENCE, WRIST, WRIST_DIFFERENCE


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
