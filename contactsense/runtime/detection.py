"""Whether a contact is present in the newest sample, and what follows from it for filter and monitor."""

import math
from typing import NamedTuple

from contactsense.detection.thresholds import sensor_set, threshold_index
from contactsense.residuals.friction_at_rest import reset_friction_at_rest
from contactsense.residuals.residual_ewma import restart_ewma, update_ewma
from contactsense.residuals.sensor_consistency import exclude_inconsistent, update_consistency
from contactsense.residuals.sensor_consistency import update_is_due as consistency_is_due
from contactsense.robots.jit.kernel import inlined_kernel
from contactsense.runtime.consistency_statistics import consistency_statistics
from contactsense.runtime.no_contact_hypothesis import (
    energy_at_rest,
    energy_of_change,
    energy_of_ewma,
    energy_without_contact,
    update_bias_filter,
)
from contactsense.runtime.residual_update import follow_noise_and_timing, residual_variance_ratio
from contactsense.runtime.state import State
from contactsense.scene_model.constants import Constants
from contactsense.sensors.stream_state import (
    BASE,
    INCONSISTENT,
    SETTLING,
    TORQUE,
    TOUCHED,
)
from contactsense.sensors.usable_sensors import usable_residuals_code, usable_sensors
from contactsense.tracking.contact_track import NONE, end_contact
from contactsense.tracking.resumed_contact import release_contact

RINGING_TIME = 0.2
"""After a contact the arm rings for about this time [s]."""
RINGING_SHARE = 0.5
"""Meanwhile the average of the residuals shows another contact only if its energy is more than this share of
the last one's peak. In the 11 hard knocks of `contactsense bench recordings` on a real UR10e, 0.12 is too
little and 0.25 enough; 0.15 s are long enough."""


class Decision(NamedTuple):
    """What was decided for one sample."""

    usable: bool
    """Whether base wrench or torques can be used."""
    touched: bool
    """Whether a contact is present."""
    onset: bool
    """Whether the energy is above the onset threshold where no contact was present."""
    base_settled: bool
    """Whether the residual of the base wrench has settled, excluded or not."""
    torque_settled: bool
    """The same for the torques."""
    variance_ratio: float
    """Variance of the residuals over that of one sample's noise."""


@inlined_kernel
def decide(constants: Constants, state: State) -> Decision:
    """Decide by the energy of the no-contact hypothesis, which is stored in `State`.

    Args:
        constants, state: After the residuals were advanced by this sample.
    """
    track, stream = state.track, state.stream
    follow_noise_and_timing(constants, state)
    base_settled, torque_settled = stream.usable[BASE] > 0, stream.usable[TORQUE] > 0
    exclude_inconsistent(state.consistency, stream.usable)
    has_base, has_torque, link_sensors = usable_sensors(stream)
    if not (has_base or has_torque):
        return Decision(False, False, False, base_settled, torque_settled, 0.0)
    variance_ratio = residual_variance_ratio(state, (has_base, has_torque, link_sensors))
    stream.clock[0].variance_ratio = variance_ratio
    used = sensor_set(has_base, has_torque, link_sensors)
    thresholds = constants.thresholds[used, threshold_index(stream.clock[0].usual_step)]
    ewma_energy = 0.0
    if thresholds[2] < math.inf:
        update_ewma(
            state.ewma, state.observers, variance_ratio, usable_residuals_code(stream), stream.clock[0].step,
            constants.bandwidth,
        )  # fmt: skip
        ewma_energy = energy_of_ewma(constants, state, has_torque, link_sensors)
    energy = energy_without_contact(constants, state, has_base, has_torque, link_sensors, variance_ratio)
    # With a base sensor, friction does not limit detection.
    if not has_base:
        energy = max(
            energy,
            energy_at_rest(constants, state, variance_ratio, (thresholds[0], thresholds[1])),
        )
    state.no_contact_energy[0] = energy
    status = track.status[0]
    above_threshold, no_contact_yet = not energy <= thresholds[0], status.phase == NONE
    may_ring = status.time_since_end <= RINGING_TIME
    ringing = RINGING_SHARE * status.peak_energy if may_ring else 0.0
    if no_contact_yet:
        # Onset needs two samples in a row above the threshold: sensors have outliers.
        touched = above_threshold and status.above_onset
        status.sustained = not touched and ewma_energy > max(thresholds[2], ringing)
    else:
        touched = not energy <= thresholds[1]
        # The average shows a weak contact that goes on, but lags behind the end of a strong one.
        status.sustained = (
            not touched
            and ewma_energy > thresholds[1]
            and energy_of_change(constants, state, has_torque, link_sensors, variance_ratio) <= thresholds[1]
        )
    touched = touched or status.sustained
    if touched:
        begins = no_contact_yet and not may_ring
        status.peak_energy = energy if begins else max(energy, status.peak_energy)
    onset = above_threshold and no_contact_yet
    return Decision(True, touched, onset, base_settled, torque_settled, variance_ratio)


@inlined_kernel
def conclude(constants: Constants, state: State, flags: int, decision: Decision) -> int:
    """Update the monitor of the sensors, and without a contact the bias filter.

    Args:
        constants, state: After `decide` for this sample. Where a contact is present or one of the two updates
            is due, `State.motion` is read.
        flags: Flags of the sample so far.
        decision: Of `decide`.

    Returns:
        All flags of the sample.
    """
    variance_ratio = decision.variance_ratio
    track, stream, consistency = state.track, state.stream, state.consistency
    if not decision.usable:
        end_contact(track)
        restart_ewma(state.ewma)
        reset_friction_at_rest(state.friction_at_rest)
        return flags | SETTLING
    dt = stream.clock[0].step
    if consistency_is_due(consistency, dt):
        consistency_statistics(constants, state, variance_ratio)
    if update_consistency(
        consistency, state.statistics, decision.touched, decision.base_settled, decision.torque_settled, dt
    ):
        flags |= INCONSISTENT
    if decision.touched:
        return flags | TOUCHED
    if track.status[0].phase != NONE:
        restart_ewma(state.ewma)
    release_contact(track, dt)
    if decision.onset:
        track.status[0].above_onset = True
    else:
        has_base, has_torque, _ = usable_sensors(stream)
        update_bias_filter(constants, state, has_base, has_torque, variance_ratio)
    return flags
