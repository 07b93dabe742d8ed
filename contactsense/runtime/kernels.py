"""The compiled functions that Python calls, once per sample or once per batch. Each first makes views of the
flat buffers."""

from typing import TypeAlias

import numpy as np

from contactsense.detection.thresholds import Usable
from contactsense.kinematics.simd_kinematics import kinematics_in_lanes, motion_of_lane
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.kernel import kernel, nogil_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.surface.signed_distance_grid import Skin
from contactsense.runtime.best_answer import store_best
from contactsense.runtime.buffers import Buffers, buffer_views
from contactsense.runtime.detection import conclude, decide
from contactsense.runtime.explanation import Measured, explain_sample, take_static_residuals
from contactsense.runtime.measurement import Measurement, take_measurement
from contactsense.runtime.newest_sample import localize
from contactsense.runtime.reading_limits import is_sample_plausible
from contactsense.runtime.residual_update import update_residuals
from contactsense.sensors.stream_state import (
    REPEATED,
    RESTARTED,
    SUSPECT,
    UNUSABLE,
    WRONG_SIZE,
    Readings,
    register_sample,
    store_sample,
)
from contactsense.tracking.contact_tracker import end_contact

BatchOutputs: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Of each of N measurements: energy of the no-contact hypothesis, shape (N,); probability of each link, shape
(N, links); row of the most probable candidate, shape (N, WIDTH), whose first number is -1 if there is none,
see `contactsense.runtime.result_rows`."""


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
def explain(
    buffers: Buffers,
    skin: Skin,
    stream: bool,
    bandwidth: float,
    gate: bool,
    measurement: Measurement,
    rows: np.ndarray,
) -> tuple[int, float]:
    """Explain a stream's newest residuals, after `detect` has detected a contact, or one measurement of an
    arm at rest.

    Either takes the whole search for contacts; one function for both is compiled in half the time.

    Args:
        buffers, skin, gate, rows: As for `localize`.
        stream: Whether it is the stream.
        bandwidth: For the stream: cut-off frequency of the observers [Hz].
        measurement: For the measurement; any values for the stream.

    Returns:
        For the stream, the number of candidates in `rows` and 0. For the measurement, the number of
        candidates, or what `take_measurement` returns if that is not 0; and the energy of the no-contact
        hypothesis.
    """
    if stream:
        return localize(buffers, skin, bandwidth, gate, rows), 0.0
    constants, state = buffer_views(buffers)
    unusable = take_measurement(constants, state, measurement)
    if unusable:
        return unusable, 0.0
    _, _, usable, threshold, _ = measurement
    listed, no_contact_energy = explain_sample(buffers, skin, usable, 1.0, gate, threshold, rows)
    store_best(listed, rows, state.hypotheses, state.answer)
    return listed, no_contact_energy


@nogil_kernel
def batch(
    buffers: Buffers,
    skin: Skin,
    measured: Measured,
    still: np.ndarray,
    external: bool,
    usable: Usable,
    gate: bool,
    found: BatchOutputs,
    lanes: np.ndarray,
) -> None:
    """`explain` for N measurements, whose arrays have a leading axis.

    Args:
        buffers, skin, usable, gate: As for `contactsense.runtime.explanation.explain_sample`.
        measured, external: As for `contactsense.runtime.explanation.take_static_sample`.
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
        listed, no_contact_energy[i] = explain_sample(buffers, skin, usable, 1.0, gate, -1.0, row)
        copy(state.link_probability, link_probability[i])
        if listed == 0:
            row[0] = 0.0
            row[0, 0] = -1.0
