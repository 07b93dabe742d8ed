"""Detection in one sample of a recording whose equations of motion were worked out in the lanes of
`contactsense.kinematics.simd_kinematics`.

Answers are those of `contactsense.runtime.kernels.detect`. Poses are copied to `State.motion` only where
something reads them: without a contact that is one sample in several.
"""

import numpy as np

from contactsense.kinematics.simd_kinematics import kinematics_in_lanes, motion_of_lane
from contactsense.residuals.bias_filter import predict
from contactsense.residuals.bias_filter import update_is_due as bias_update_is_due
from contactsense.residuals.observers import start_steps
from contactsense.residuals.sensor_consistency import update_is_due as consistency_is_due
from contactsense.residuals.simd_equations import (
    advance_base,
    advance_joints,
    advance_torque_difference,
    equations_in_lanes,
)
from contactsense.residuals.velocity_noise import follow_velocity_noise
from contactsense.robots.jit.kernel import inlined_kernel
from contactsense.runtime.detection import conclude, decide
from contactsense.runtime.residual_update import (
    observe_link_sensors,
    predict_link_sensors,
    set_residuals,
    update_link_sensors,
)
from contactsense.runtime.state import State
from contactsense.scene_model.constants import Constants
from contactsense.sensors.stream_state import (
    BASE,
    LINK,
    REPEATED,
    RESTARTED,
    TORQUE,
    TORQUE_DIFFERENCE,
    UNUSABLE,
    Readings,
    register_sample,
    store_sample,
)
from contactsense.tracking.contact_track import NONE, end_contact


@inlined_kernel
def fill_lanes(
    constants: Constants,
    state: State,
    first: int,
    q: np.ndarray,
    qd: np.ndarray,
    torque: np.ndarray,
    base_wrench: np.ndarray,
    lanes: np.ndarray,
) -> None:
    """Work out the equations of motion of samples `first`, `first` + 1, ... with today's biases and masses;
    arrays as for `contactsense.runtime.block_kernel.detect_and_localize_block`."""
    kinematics_in_lanes(state.model, constants.gravity, q, qd, first, lanes)
    equations_in_lanes(
        state.model, state.torque_model, state.bias_filter.bias, torque, base_wrench, first, lanes
    )


@inlined_kernel
def detect_in_lane(
    constants: Constants,
    state: State,
    lanes: np.ndarray,
    lane: int,
    t: float,
    sensor_bits: int,
    readings: Readings,
) -> int:
    """As `contactsense.runtime.kernels.detect`, for the sample of one lane."""
    stream = state.stream
    store_sample(stream, readings)
    flags: int = register_sample(stream, t, sensor_bits, constants.bandwidth)
    if flags & (REPEATED | UNUSABLE):
        return flags
    if flags & RESTARTED:
        end_contact(state.track)
    copied = (
        follow_velocity_noise(state.velocity_noise, stream.qd, stream.clock[0].step)
        or _has_link_sensor(state)
        or state.bias_filter.status[0].estimates_masses
        or state.track.status[0].phase != NONE
    )
    if copied:
        _copy_motion(constants, state, lanes, lane)
    _update_residuals(constants, state, lanes, lane)
    decision = decide(constants, state)
    if (
        decision.touched
        or consistency_is_due(state.consistency, stream.clock[0].step)
        or bias_update_is_due(state.bias_filter, constants.bandwidth)
    ) and not copied:
        _copy_motion(constants, state, lanes, lane)
    concluded: int = conclude(constants, state, flags, decision)
    return concluded


@inlined_kernel
def _copy_motion(constants: Constants, state: State, lanes: np.ndarray, lane: int) -> None:
    motion_of_lane(lanes, lane, state.motion)
    update_link_sensors(constants, state)


@inlined_kernel
def _has_link_sensor(state: State) -> bool:
    """Whether a link sensor has a value in the newest sample, or can be used without one."""
    steps, usable = state.stream.steps, state.stream.usable
    found = False
    for i in range(LINK, LINK + state.link_load.shape[0]):
        found = found or steps[i] >= 0.0 or usable[i] > 0
    return found


@inlined_kernel
def _update_residuals(constants: Constants, state: State, lanes: np.ndarray, lane: int) -> None:
    """As `contactsense.runtime.residual_update.update_residuals`."""
    motion, stream, steps = state.motion, state.stream, state.stream.steps
    bandwidth = constants.bandwidth
    base, joints, difference = state.observers.base, state.observers.joints, state.observers.torque_difference
    of_base, of_joints, of_difference = start_steps(state.observers, steps, bandwidth)
    if steps[BASE] >= 0.0:
        advance_base(lanes, lane, of_base, base)
    if steps[TORQUE] >= 0.0:
        friction = state.bias_filter.friction_regressor
        std = state.stream_unmodelled_std
        advance_joints(lanes, lane, of_joints, joints, std, friction)
    if steps[TORQUE_DIFFERENCE] >= 0.0:
        advance_torque_difference(lanes, lane, of_difference, difference)
    for i in range(6):
        state.unbiased_wrench[i] = stream.base_wrench[i] - state.bias_filter.bias[i]
    observe_link_sensors(constants, state)
    predict(
        state.bias_filter, state.torque_model, motion, constants.sensors.base_covariance,
        constants.sensors.torque_variance, constants.bias_rate, stream.clock[0].step,
        stream.clock[0].usual_step, bandwidth,
    )  # fmt: skip
    predict_link_sensors(constants, state)
    set_residuals(state)
