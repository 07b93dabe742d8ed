"""The compiled functions that Python calls, once per sample or once per batch. Each first makes views of the
flat buffers."""

import math

import numpy as np

from contactsense.detection.thresholds import Usable
from contactsense.residuals.equations_of_motion import wrench_difference
from contactsense.residuals.sensor_consistency import NO_CONTACT
from contactsense.robots.jit.array_views import block, copy
from contactsense.robots.jit.kernel import inlined_kernel, kernel, nogil_kernel
from contactsense.robots.surface.signed_distance_grid import Skin
from contactsense.runtime.best_answer import store_best
from contactsense.runtime.buffers import Buffers, buffer_views
from contactsense.runtime.constants import Constants
from contactsense.runtime.detection import conclude, decide
from contactsense.runtime.explanation import Measured, explain_sample, take_static_sample
from contactsense.runtime.reading_limits import (
    TORQUE_SCALE,
    are_positions_within,
    are_torques_within,
    is_base_plausible,
    is_contact_wrench,
    is_sample_plausible,
)
from contactsense.runtime.residual_update import set_external, update_residuals, use_residuals
from contactsense.runtime.state import State
from contactsense.sensors.stream_state import (
    REPEATED,
    RESTARTED,
    SUSPECT,
    UNUSABLE,
    WRONG_SIZE,
    Readings,
    register_sample,
    store_sample,
    usable_sensors,
    usable_sensors_code,
)
from contactsense.tracking.contact_tracker import (
    NONE,
    average_windows,
    choose_window,
    end_contact,
    update_phase,
)
from contactsense.tracking.resumed_contact import add_to_links, number_contact
from contactsense.tracking.sliding import extrapolate_sliding

NOT_FINITE, DOUBTFUL = -1, -2
"""What `locate_once` returns instead of a number of candidates."""


@kernel
def detect(
    buffers: Buffers,
    bandwidth: float,
    t: float,
    sensor_bits: int,
    readings: Readings,
    screened: bool,
) -> int:
    """Detect a contact in one sample of a live stream.

    Without a contact the bias filter is updated.

    Args:
        buffers: `contactsense.runtime.buffers.KernelBuffers.arguments`.
        bandwidth: Cut-off frequency of the observers [Hz].
        t: Time of the sample [s].
        sensor_bits: Which sensors have a value, see `contactsense.sensors.stream_state.register_sample`.
        readings: See `contactsense.sensors.stream_state.Readings`; any values for a sensor without a value.
        screened: Whether the readings are known to be plausible; otherwise that is checked, and a sample
            whose readings may not be is not used.

    Returns:
        Flags of the sample, see `contactsense.sensors.stream_state`.
    """
    constants, state = buffer_views(buffers)
    stream = state.stream
    if not store_sample(stream, readings):
        return WRONG_SIZE
    if not screened and not is_sample_plausible(
        constants.limits, stream.q, stream.torque, stream.base_wrench, sensor_bits
    ):
        return SUSPECT
    flags: int = register_sample(stream, t, sensor_bits, bandwidth)
    if flags & (REPEATED | UNUSABLE):
        return flags
    if flags & RESTARTED:
        end_contact(state.track)
    update_residuals(constants, state, bandwidth)
    decision = decide(constants, state, bandwidth)
    concluded: int = conclude(constants, state, flags, decision, bandwidth)
    return concluded


@kernel
def localize(
    buffers: Buffers,
    skin: Skin,
    bandwidth: float,
    gate: bool,
    rows: np.ndarray,
) -> int:
    """Average the residuals over windows and explain them, after `detect` has detected a contact.

    Args:
        buffers: `contactsense.runtime.buffers.KernelBuffers.arguments`.
        skin: The fields of `contactsense.robots.surface.signed_distance_grid.Grids`, as a plain tuple.
        bandwidth: Cut-off frequency of the observers [Hz].
        gate: As for `contactsense.runtime.explanation.explain_sample`.
        rows: Filled with the candidates.

    Returns:
        Number of candidates in `rows`.
    """
    constants, state = buffer_views(buffers)
    track, stream = state.track, state.stream
    dt, begins = stream.clock[0].step, track.status[0].phase == NONE
    state.bias_filter.status[0].time_since_contact = 0.0
    average_windows(
        track,
        state.observers,
        stream.clock[0].variance_ratio,
        usable_sensors_code(stream),
        dt,
        bandwidth,
    )
    has_base, has_torque, link_sensors = usable_sensors(stream)
    slid = choose_window(constants.sensors, track, state.motion, has_base, dt, bandwidth)
    update_phase(track, slid, dt, bandwidth)
    window = track.status[0].window
    if window > 0:
        _use_window_mean(state, window)
    else:
        use_residuals(state)
    usable = (has_base, has_torque, link_sensors)
    listed, _ = explain_sample(buffers, skin, usable, track.variance_ratio[window], gate, -1.0, rows)
    if begins:
        number_contact(track, constants.link_prior, state.link_probability, bandwidth)
    add_to_links(track, state.statistics[NO_CONTACT], state.link_probability)
    if listed > 0:
        if has_base:
            extrapolate_sliding(track, state.motion, constants.sensors.depth[int(rows[0, 0])], rows[0])
            if window > 0:
                _update_to_newest(constants, state, window, rows[:listed])
        _store_last_contact(constants, state, rows[0])
    store_best(listed, rows, state.hypotheses, state.answer)
    return listed


@kernel
def is_finite_vector(vector: np.ndarray, size: int) -> bool:
    """Whether a vector has `size` numbers, all finite. NumPy takes ten times as long for six of them."""
    if len(vector) != size:
        return False
    for value in vector:  # noqa: SIM110 (a generator cannot be compiled)
        if not math.isfinite(value):
            return False
    return True


@inlined_kernel
def _use_window_mean(state: State, window: int) -> None:
    """Replace the observers' residuals by a window's mean."""
    n, link_sensors = state.torque.shape[0], state.link_wrench.shape[0]
    mean = state.track.mean[window]
    a = 6 * (n + 1)
    b = a + n
    c = b + n
    d = c + 6 * link_sensors
    difference, residual = block(mean, c, (link_sensors, 6)), block(mean, d, (link_sensors, 6))
    set_external(state, mean[:a], mean[a:b], mean[b:c], difference, residual)


@inlined_kernel
def _store_last_contact(constants: Constants, state: State, row: np.ndarray) -> None:
    """Store body, point and normal of the best candidate for the next sample."""
    body = constants.sensors.depth[int(row[0])]
    R = state.motion.rotation[body]
    track = state.track
    track.status[0].last_body = body
    for i in range(3):
        track.last_point[i] = row[4 + i]
        track.last_normal[i] = R[0, i] * row[10] + R[1, i] * row[11] + R[2, i] * row[12]


@inlined_kernel
def _update_to_newest(constants: Constants, state: State, window: int, rows: np.ndarray) -> None:
    """Update force, torsion and wrench from the window mean to the newest residual; point and link remain
    those of the window mean."""
    track = state.track
    wrench_change = state.wrench_change
    for k in range(rows.shape[0]):
        row = rows[k]
        body = constants.sensors.depth[int(row[0])]
        wrench_difference(state.motion, track.mean[0], track.mean[window], body, wrench_change)
        fx, fy, fz = wrench_change[0], wrench_change[1], wrench_change[2]
        cx, cy, cz = row[7], row[8], row[9]
        row[13] += fx
        row[14] += fy
        row[15] += fz
        row[3] += (
            row[10] * (wrench_change[3] - cy * fz + cz * fy)
            + row[11] * (wrench_change[4] - cz * fx + cx * fz)
            + row[12] * (wrench_change[5] - cx * fy + cy * fx)
        )
    wrench, covariance = state.hypotheses.wrench, state.hypotheses.covariance
    covariance_factor = track.variance_ratio[0] / track.variance_ratio[window]
    for link in range(wrench.shape[0]):
        wrench_difference(
            state.motion, track.mean[0], track.mean[window], constants.sensors.depth[link], wrench_change
        )
        for i in range(6):
            wrench[link, i] += wrench_change[i]
            for j in range(6):
                covariance[link, i, j] *= covariance_factor


@kernel
def locate_once(
    buffers: Buffers,
    skin: Skin,
    measured: Measured,
    external: bool,
    usable: Usable,
    gate: bool,
    threshold: float,
    check: bool,
    rows: np.ndarray,
) -> tuple[int, float]:
    """One sample of an arm at rest: `take_static_sample` and `explain_sample`.

    Args:
        buffers, skin, gate, rows: As for `localize`.
        measured, external: As for `take_static_sample`.
        usable: Which sensors have measured.
        threshold: As for `explain_sample`.
        check: Whether the measurement is checked: may it be implausible, apart from link sensors with a known
            range, it is not explained.

    Returns:
        Number of candidates in `rows`, and the energy of the no-contact hypothesis; `NOT_FINITE` and 0 where
        a vector has the wrong size or is not finite, `DOUBTFUL` and 0 where the measurement may be
        implausible.
    """
    constants, state = buffer_views(buffers)
    q, torque, base_wrench, link_wrench = measured
    n = state.torque.shape[0]
    if not (is_finite_vector(q, n) and is_finite_vector(torque, n) and is_finite_vector(base_wrench, 6)):
        return NOT_FINITE, 0.0
    for s in range(link_wrench.shape[0]):
        if not is_finite_vector(link_wrench[s], 6):
            return NOT_FINITE, 0.0
    take_static_sample(constants, state, measured, external)
    if check and not _is_plausible(constants, state, measured, external, usable):
        return DOUBTFUL, 0.0
    listed, no_contact_energy = explain_sample(buffers, skin, usable, 1.0, gate, threshold, rows)
    store_best(listed, rows, state.hypotheses, state.answer)
    return listed, no_contact_energy


@inlined_kernel
def _is_plausible(
    constants: Constants, state: State, measured: Measured, external: bool, usable: Usable
) -> bool:
    """Whether a measurement is surely plausible, apart from link sensors with a known range; arguments as for
    `locate_once`, after `take_static_sample`."""
    q, torque, base_wrench, link_wrench = measured
    limits, weight = constants.limits, state.motion.gravity[0]
    # What remains of a plausible torque after a plausible model's is subtracted.
    scale = TORQUE_SCALE + 1.0 if external else TORQUE_SCALE
    if not are_positions_within(limits, q) or (usable[1] and not are_torques_within(limits, torque, scale)):
        return False
    for s in range(link_wrench.shape[0]):
        if not is_contact_wrench(link_wrench[s], weight):
            return False
    return not usable[0] or is_base_plausible(limits, base_wrench, weight, external, state.wrench_change)


@nogil_kernel
def batch(
    buffers: Buffers,
    skin: Skin,
    measured: Measured,
    external: bool,
    usable: Usable,
    gate: bool,
    no_contact_energy: np.ndarray,
    link_probability: np.ndarray,
    best: np.ndarray,
    rows: np.ndarray,
) -> None:
    """`locate_once` for N samples, whose arrays have a leading axis. The best candidate of each is written to
    a row of `best`, whose first number is -1 if there is none."""
    constants, state = buffer_views(buffers)
    q, torque, base_wrench, link_wrench = measured
    for i in range(q.shape[0]):
        take_static_sample(constants, state, (q[i], torque[i], base_wrench[i], link_wrench[i]), external)
        listed, no_contact_energy[i] = explain_sample(buffers, skin, usable, 1.0, gate, -1.0, rows[:1])
        copy(state.link_probability, link_probability[i])
        if listed > 0:
            copy(rows[0], best[i])
        else:
            best[i] = 0.0
            best[i, 0] = -1.0
