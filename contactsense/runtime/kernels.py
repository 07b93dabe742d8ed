"""The compiled functions that Python calls, once per sample or once per batch. Each first makes views of the
flat buffers."""

import math
from typing import TypeAlias

import numpy as np

from contactsense.kinematics.simd_kinematics import kinematics_in_lanes, motion_of_lane
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.kernel import kernel, nogil_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.surface.signed_distance_grid import Skin
from contactsense.runtime.answer import store_first
from contactsense.runtime.buffers import Buffers, buffer_views
from contactsense.runtime.detection import conclude, decide
from contactsense.runtime.explanation import explain_sample
from contactsense.runtime.measurement import UNTOUCHED, take_measurement
from contactsense.runtime.newest_sample import localize
from contactsense.runtime.residual_update import update_residuals
from contactsense.runtime.static_residuals import Measured, take_static_residuals
from contactsense.scene_model.reading_limits import is_sample_plausible
from contactsense.sensors.stream_state import (
    REPEATED,
    RESTARTED,
    SUSPECT,
    TOUCHED,
    UNUSABLE,
    WRONG_SIZE,
    Readings,
    register_sample,
    store_sample,
)
from contactsense.sensors.usable_sensors import Usable, sensors_in
from contactsense.tracking.contact_track import end_contact

LINK_FIRST, SCREENED, DETECTED, AT_REST, EXTERNAL, CHECKED, DETECT_ONLY = 1, 2, 4, 8, 16, 32, 64
"""Options of `process`, bits of one number. `LINK_FIRST`: as `link_first` of
`contactsense.runtime.explanation.explain_sample`. `SCREENED`: the readings are known to be plausible;
otherwise that is checked, and a sample whose readings may not be is not used. `DETECTED`: a contact has been
detected in the stream's newest sample, which is explained; no sample is taken. `AT_REST`: it is no sample of
the stream, but one measurement of an arm at rest; `EXTERNAL` and `CHECKED` are then those of
`contactsense.runtime.measurement.take_measurement`, and `DETECT_ONLY`: a contact in it is not explained."""

BatchOutputs: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Of each of N measurements: energy of the no-contact hypothesis, shape (N,); probability of each link, shape
(N, links); row of the most probable candidate, shape (N, WIDTH), whose first number is -1 if there is none,
see `contactsense.runtime.result_rows`."""


@kernel
def process(
    buffers: Buffers, skin: Skin, options: int, t: float, sensor_bits: int, readings: Readings
) -> int:
    """Detect a contact in one sample of a live stream and, if there is one, explain it; or explain one
    measurement of an arm at rest.

    One call for each sample, since a call takes a good part of the time of an explanation; one function for
    both, since the whole search would be compiled again for a second one.

    Args:
        buffers: `contactsense.runtime.buffers.KernelBuffers.arguments`; what is found is in `State.answer`.
        skin: The fields of `contactsense.robots.surface.signed_distance_grid.Grids`, as a plain tuple.
        options: See `LINK_FIRST`.
        t: Time of the sample [s]; of a measurement, `threshold` of
            `contactsense.runtime.explanation.explain_sample`.
        sensor_bits: Which sensors have a value, see `contactsense.sensors.usable_sensors.sensor_bits_of`.
        readings: See `contactsense.sensors.stream_state.Readings`; any values for a sensor without a value,
            and for the velocities of a measurement.

    Returns:
        Of a sample, its flags, see `contactsense.sensors.stream_state`. Of a measurement, the number of
        candidates, or why there are none, see `contactsense.runtime.measurement`.
    """
    link_first = options & LINK_FIRST != 0
    if options & AT_REST:
        return _explain_measurement(buffers, skin, options, t, sensor_bits, readings)
    if options & DETECTED:
        localize(buffers, skin, link_first)
        return TOUCHED
    flags: int = detect(buffers, t, sensor_bits, readings, options & SCREENED != 0)
    if flags & TOUCHED:
        localize(buffers, skin, link_first)
    return flags


@kernel
def detect(buffers: Buffers, t: float, sensor_bits: int, readings: Readings, screened: bool) -> int:
    """Detect a contact in one sample of a live stream. Without a contact the bias filter is updated.

    Arguments and result as for `process`.
    """
    constants, state = buffer_views(buffers)
    stream = state.stream
    if not store_sample(stream, readings):
        return WRONG_SIZE
    if not screened and not is_sample_plausible(
        constants.limits, stream.q, stream.torque, stream.base_wrench, sensor_bits
    ):
        return SUSPECT
    flags: int = register_sample(stream, t, sensor_bits, constants.bandwidth)
    if flags & (REPEATED | UNUSABLE):
        return flags
    if flags & RESTARTED:
        end_contact(state.track)
    update_residuals(constants, state)
    decision = decide(constants, state)
    concluded: int = conclude(constants, state, flags, decision)
    return concluded


@kernel
def _explain_measurement(
    buffers: Buffers, skin: Skin, options: int, threshold: float, sensor_bits: int, readings: Readings
) -> int:
    """`process` for a measurement of an arm at rest."""
    constants, state = buffer_views(buffers)
    q, _, torque, base_wrench, link_wrench = readings
    usable = sensors_in(sensor_bits)
    unusable: int = take_measurement(
        constants,
        state,
        (q, torque, base_wrench, link_wrench),
        options & EXTERNAL != 0,
        usable,
        options & CHECKED != 0,
    )
    if unusable:
        return unusable
    rows = state.answer.rows
    unexplained = math.inf if options & DETECT_ONLY else threshold
    listed, energy = explain_sample(buffers, skin, usable, 1.0, options & LINK_FIRST != 0, unexplained, rows)
    if energy <= threshold:
        return UNTOUCHED
    store_first(listed, rows, state.hypotheses, constants.surfaces.start, state.answer)
    return int(listed)


@nogil_kernel
def batch(
    buffers: Buffers,
    skin: Skin,
    measured: Measured,
    still: np.ndarray,
    external: bool,
    usable: Usable,
    link_first: bool,
    found: BatchOutputs,
    lanes: np.ndarray,
) -> None:
    """Explain N measurements of an arm at rest, whose arrays have a leading axis.

    Args:
        buffers, skin, usable, link_first: As for `contactsense.runtime.explanation.explain_sample`.
        measured, external: As for `contactsense.runtime.static_residuals.take_static_residuals`.
        still: Zeros, the joint velocities, shape (N, n).
        found: Filled.
        lanes: Scratch, see `contactsense.kinematics.simd_kinematics.empty_lanes`.
    """
    constants, state = buffer_views(buffers)
    q, torque, base_wrench, link_wrench = measured
    no_contact_energy, link_probability, best = found
    for i in range(q.shape[0]):
        lane = i % LANES
        if lane == 0:
            kinematics_in_lanes(constants.model, constants.gravity, q, still, i, lanes)
        motion_of_lane(lanes, lane, state.motion)
        take_static_residuals(constants, state, (q[i], torque[i], base_wrench[i], link_wrench[i]), external)
        row = best[i : i + 1]
        listed, no_contact_energy[i] = explain_sample(buffers, skin, usable, 1.0, link_first, -1.0, row)
        copy(state.link_probability, link_probability[i])
        if listed == 0:
            row[0] = 0.0
            row[0, 0] = -1.0
