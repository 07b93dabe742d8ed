"""Explain a stream's newest residuals by a contact."""

import numpy as np

from contactsense.residuals.equations_of_motion import wrench_difference
from contactsense.residuals.observers import current_parts, parts_of
from contactsense.robots.jit.array_views import view
from contactsense.robots.jit.kernel import inlined_kernel, kernel
from contactsense.robots.surface.signed_distance_grid import Skin
from contactsense.robots.vectors import cross, dot, rotate_back, subtract, vector
from contactsense.runtime.answer import NUMBER, PHASE, SENSORS, store_first
from contactsense.runtime.buffers import Buffers, buffer_views
from contactsense.runtime.explanation import explain_sample
from contactsense.runtime.residual_update import set_external
from contactsense.runtime.result_rows import (
    FIRST_COVARIANCE,
    FIRST_FORCE,
    FIRST_NORMAL,
    FIRST_POINT,
    FIRST_POINT_BASE,
    LINK,
    TORSION,
)
from contactsense.runtime.state import State
from contactsense.scene_model.constants import Constants
from contactsense.sensors.stream_state import TORQUE
from contactsense.sensors.usable_sensors import usable_residuals_code, usable_sensors
from contactsense.tracking.contact_track import NONE
from contactsense.tracking.contact_tracker import choose_window, update_phase
from contactsense.tracking.resumed_contact import add_to_links, number_contact
from contactsense.tracking.sliding import extrapolate_sliding
from contactsense.tracking.window_averages import average_windows


@kernel
def localize(
    buffers: Buffers,
    skin: Skin,
    link_first: bool,
) -> int:
    """Average the residuals over windows and explain them, after `detect` has detected a contact.

    Args:
        buffers: `contactsense.runtime.buffers.KernelBuffers.arguments`; `State.answer` is filled.
        skin: The fields of `contactsense.robots.surface.signed_distance_grid.Grids`, as a plain tuple.
        link_first: As for `contactsense.runtime.explanation.explain_sample`.

    Returns:
        Number of candidates.
    """
    constants, state = buffer_views(buffers)
    track, stream, bandwidth = state.track, state.stream, constants.bandwidth
    answer, sensors = state.answer, usable_residuals_code(stream)
    rows = answer.rows
    dt, begins = stream.clock[0].step, track.status[0].phase == NONE
    state.bias_filter.status[0].time_since_contact = 0.0
    average_windows(
        track,
        state.ewma,
        state.observers,
        stream.clock[0].variance_ratio,
        sensors,
        dt,
        bandwidth,
    )
    usable = usable_sensors(stream)
    has_base = usable[0]
    base_noise = (state.base_noise, state.base_velocity_error.noise)
    torque_noise = (constants.sensors.torque_variance, state.noise_scale.noise[TORQUE].scale)
    slid = choose_window(torque_noise, base_noise, track, state.motion, usable, dt, bandwidth)
    update_phase(track, slid, dt, bandwidth)
    window = track.status[0].window
    if window > 0:
        joints, sensors_in_arm = state.torque.shape[0], state.link_wrench.shape[0]
        set_external(state, parts_of(track.mean[window], joints, sensors_in_arm))
    else:
        set_external(state, current_parts(state.observers))
    listed, _ = explain_sample(
        buffers, skin, usable, track.windows[window].variance_ratio, link_first, -1.0, rows
    )
    if begins:
        number_contact(track, constants.link_prior, state.link_probability, bandwidth)
    add_to_links(track, state.no_contact_energy[0], state.link_probability)
    if listed > 0:
        if has_base:
            _extrapolate_sliding(constants, state, rows[0])
            if window > 0:
                _update_to_newest(constants, state, window, rows[:listed])
        elif track.status[0].magnitude != 1.0:
            _scale_forces(state, track.status[0].magnitude, rows[:listed])
        _store_last_contact(constants, state, rows[0])
    store_first(listed, rows, state.hypotheses, constants.surfaces.start, answer)
    answer.integers[PHASE], answer.integers[NUMBER] = track.status[0].phase, track.status[0].number
    answer.integers[SENSORS] = sensors
    return listed


@inlined_kernel
def _extrapolate_sliding(constants: Constants, state: State, row: np.ndarray) -> None:
    """Shift the best candidate to the present position of a sliding contact."""
    body = constants.sensors.depth[int(row[LINK])]
    point, point_base = view(row, FIRST_POINT, (3,)), view(row, FIRST_POINT_BASE, (3,))
    extrapolate_sliding(
        state.track, state.motion, body, point, point_base, view(row, FIRST_COVARIANCE, (3, 3))
    )


@inlined_kernel
def _store_last_contact(constants: Constants, state: State, row: np.ndarray) -> None:
    """Store body, point and normal of the best candidate for the next sample."""
    body = constants.sensors.depth[int(row[LINK])]
    R = state.motion.rotation[body]
    track = state.track
    track.status[0].last_body = body
    for i in range(3):
        track.last_point[i] = row[FIRST_POINT + i]
    normal = rotate_back(R, vector(view(row, FIRST_NORMAL, (3,))))
    for i in range(3):
        track.last_normal[i] = normal[i]


@inlined_kernel
def _scale_forces(state: State, magnitude: float, rows: np.ndarray) -> None:
    """Scale force and torsion of the candidates, and the wrench for the link of the first one, from the mean
    of the window to the present magnitude; point and link remain those of the mean."""
    for k in range(rows.shape[0]):
        row = rows[k]
        for i in range(3):
            row[FIRST_FORCE + i] *= magnitude
        row[TORSION] *= magnitude
    link = int(rows[0, LINK])
    wrench, covariance = state.hypotheses.wrench[link], state.hypotheses.covariance[link]
    for i in range(6):
        wrench[i] *= magnitude
        for j in range(6):
            covariance[i, j] *= magnitude * magnitude


@inlined_kernel
def _update_to_newest(constants: Constants, state: State, window: int, rows: np.ndarray) -> None:
    """Update force and torsion of the candidates, and the wrench for the link of the first one, from the
    window mean to the newest residual; point and link remain those of the window mean."""
    track = state.track
    wrench_change = state.wrench_change
    for k in range(rows.shape[0]):
        row = rows[k]
        link = int(row[LINK])
        body = constants.sensors.depth[link]
        wrench_difference(state.motion, track.mean[0], track.mean[window], body, wrench_change)
        force, moment = vector(wrench_change), vector(view(wrench_change, 3, (3,)))
        point = vector(view(row, FIRST_POINT_BASE, (3,)))
        for i in range(3):
            row[FIRST_FORCE + i] += force[i]
        normal = vector(view(row, FIRST_NORMAL, (3,)))
        row[TORSION] += dot(normal, subtract(moment, cross(point, force)))
        if k == 0:
            wrench, covariance = state.hypotheses.wrench[link], state.hypotheses.covariance[link]
            covariance_factor = track.windows[0].variance_ratio / track.windows[window].variance_ratio
            for i in range(6):
                wrench[i] += wrench_change[i]
                for j in range(6):
                    covariance[i, j] *= covariance_factor
