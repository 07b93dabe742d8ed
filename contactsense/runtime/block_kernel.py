"""Many samples of a recording in one call: what `detect` and `localize` find in each, without Python between
them."""

import math
from typing import TypeAlias

import numpy as np

from contactsense.residuals.bias_filter import friction_above_scene
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.surface.signed_distance_grid import Skin
from contactsense.runtime.block_columns import (
    BASE_WRENCH,
    BASE_WRENCH_STD,
    BIAS,
    CONSISTENCY,
    ENERGY,
    FRICTION,
    JOINTS,
    TORQUE,
    TORQUE_STD,
)
from contactsense.runtime.buffers import Buffers, buffer_views
from contactsense.runtime.newest_sample import localize
from contactsense.runtime.simd_samples import detect_in_lane, fill_lanes
from contactsense.sensors.stream_state import REPEATED, RESTARTED, TOUCHED, UNUSABLE
from contactsense.sensors.usable_sensors import usable_sensors

BlockInputs: TypeAlias = tuple[
    np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray
]
"""Times, sensors that have a value (one bit each), then what `contactsense.sensors.stream_state.Readings`
lists, each with a leading axis N."""
BlockOutputs: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Of each of the N samples: flags, int64; phase and number of the contact, and whether the residuals of base
wrench and joint torques can be used (bits 0 and 1), shape (N, 3), int64; numbers in the columns of
`contactsense.runtime.block_columns`; number of explanations, -1 where nothing touches, int64; where there is
one, the row of the most probable one, shape (N, WIDTH), and the probability of each link, shape (N, links).
"""


@kernel
def detect_and_localize_block(
    buffers: Buffers,
    skin: Skin,
    settings: tuple[bool, int],
    stop_at_touch: bool,
    first: int,
    samples: BlockInputs,
    out: BlockOutputs,
    lanes: np.ndarray,
) -> int:
    """Work through samples `first`, `first` + 1, ... of a block.

    Args:
        buffers, skin: As for `contactsense.runtime.newest_sample.localize`.
        settings: `link_first` as for `localize`; mask of the flags that can be set for samples of this scene.
        stop_at_touch: Return after the first sample that touches, ends a contact or restarts the stream;
            `localize` is not called.
        first: Sample to begin with.
        samples: Those of the block.
        out: Filled.
        lanes: Scratch, see `contactsense.kinematics.simd_kinematics.empty_lanes`.

    Returns:
        Number of the sample after the last one that was taken, negative where `stop_at_touch` ended it.
    """
    constants, state = buffer_views(buffers)
    link_first, relevant = settings
    t, sensor_bits, q, qd, torque, base_wrench, link_wrench = samples
    flags, phases, residuals, listed, best, link_probability = out
    n = state.torque.shape[0]
    first_lane = first - LANES
    for i in range(first, t.shape[0]):
        before = state.track.status[0].phase
        if i >= first_lane + LANES:
            first_lane = i
            fill_lanes(constants, state, i, q, qd, torque, base_wrench, lanes)
        found = relevant & detect_in_lane(
            constants, state, lanes, i - first_lane, t[i], sensor_bits[i],
            (q[i], qd[i], torque[i], base_wrench[i], link_wrench[i]),
        )  # fmt: skip
        if state.bias_filter.status[0].time_since_update == 0.0:
            # Biases, friction or masses have changed.
            first_lane = i + 1 - LANES
        flags[i] = found
        listed[i] = -1
        row = residuals[i]
        if found & (REPEATED | UNUSABLE):
            for k in range(row.shape[0]):
                row[k] = math.nan
        else:
            scale = state.stream.clock[0].variance_ratio
            row[ENERGY] = state.no_contact_energy[0]
            for k in range(3):
                row[CONSISTENCY + k] = state.consistency.mean_statistic[k]
            for k in range(6):
                row[BASE_WRENCH + k] = state.base_wrench[k]
                row[BASE_WRENCH_STD + k] = math.sqrt(state.base_covariance[k, k] * scale)
            for k in range(n):
                row[JOINTS + n * TORQUE + k] = state.torque[k]
                row[JOINTS + n * TORQUE_STD + k] = math.sqrt(state.torque_variance[k])
                row[JOINTS + n * BIAS + k] = state.torque_model.bias[k]
                row[JOINTS + n * FRICTION + k] = friction_above_scene(
                    state.bias_filter, state.torque_model, k
                )
        if found & TOUCHED and not stop_at_touch:
            listed[i] = localize(buffers, skin, link_first)
            if listed[i] > 0:
                copy(state.answer.rows[0], best[i])
                copy(state.link_probability, link_probability[i])
        phases[i, 0], phases[i, 1] = state.track.status[0].phase, state.track.status[0].number
        has_base, has_torque, _ = usable_sensors(state.stream)
        phases[i, 2] = has_base + 2 * has_torque
        if stop_at_touch and (found & (TOUCHED | RESTARTED) or before != state.track.status[0].phase):
            return -i - 1
    return int(t.shape[0])
