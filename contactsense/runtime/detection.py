"""Whether a contact is present in the newest sample, and what follows from it for filter and monitor."""

from contactsense.detection.thresholds import sensor_set, threshold_index
from contactsense.residuals.friction_at_rest import reset_friction_at_rest
from contactsense.residuals.sensor_consistency import NO_CONTACT, exclude_inconsistent, update_consistency
from contactsense.residuals.sensor_consistency import update_is_due as consistency_is_due
from contactsense.robots.jit.kernel import inlined_kernel
from contactsense.runtime.consistency_statistics import consistency_statistics
from contactsense.runtime.constants import Constants
from contactsense.runtime.no_contact_hypothesis import (
    energy_at_rest,
    energy_without_contact,
    update_bias_filter,
)
from contactsense.runtime.residual_update import follow_noise_and_timing, residual_variance_ratio
from contactsense.runtime.state import State
from contactsense.sensors.stream_state import (
    BASE,
    INCONSISTENT,
    SETTLING,
    TORQUE,
    TOUCHED,
    usable_sensors,
)
from contactsense.tracking.contact_tracker import NONE, end_contact
from contactsense.tracking.resumed_contact import release_contact


@inlined_kernel
def decide(
    constants: Constants, state: State, bandwidth: float
) -> tuple[bool, bool, bool, bool, bool, float]:
    """Decide by the energy of the no-contact hypothesis, which is stored in `State.statistics`.

    Args:
        constants, state: After the residuals were advanced by this sample.
        bandwidth: Cut-off frequency of the observers [Hz].

    Returns:
        Whether base wrench or torques can be used, whether a contact is present, whether the energy is above
        the onset of one where none was present; whether base wrench and torques have settled, excluded or
        not; and the variance of the residuals over that of one sample's noise.
    """
    track, stream = state.track, state.stream
    follow_noise_and_timing(constants, state, bandwidth)
    base_settled, torque_settled = stream.usable[BASE] > 0, stream.usable[TORQUE] > 0
    exclude_inconsistent(state.consistency, stream.usable)
    has_base, has_torque, link_sensors = usable_sensors(stream)
    if not (has_base or has_torque):
        return False, False, False, base_settled, torque_settled, 0.0
    variance_ratio = residual_variance_ratio(state, (has_base, has_torque, link_sensors))
    stream.clock[0].variance_ratio = variance_ratio
    used = sensor_set(has_base, has_torque, link_sensors)
    thresholds = constants.thresholds[used, threshold_index(stream.clock[0].usual_step)]
    energy = energy_without_contact(constants, state, has_base, has_torque, link_sensors, variance_ratio)
    # With a base sensor, friction does not limit detection.
    if not has_base:
        energy = max(
            energy,
            energy_at_rest(constants, state, variance_ratio, (thresholds[0], thresholds[1]), bandwidth),
        )
    state.statistics[NO_CONTACT] = energy
    # Onset needs two samples in a row above the threshold: sensors have outliers.
    above_threshold, no_contact_yet = not energy <= thresholds[0], track.status[0].phase == NONE
    touched = (
        above_threshold and track.status[0].above_onset if no_contact_yet else not energy <= thresholds[1]
    )
    onset = above_threshold and no_contact_yet
    return True, touched, onset, base_settled, torque_settled, variance_ratio


@inlined_kernel
def conclude(
    constants: Constants,
    state: State,
    flags: int,
    decision: tuple[bool, bool, bool, bool, bool, float],
    bandwidth: float,
) -> int:
    """Update the monitor of the sensors, and without a contact the bias filter.

    Args:
        constants, state: After `decide` for this sample. Where a contact is present or one of the two updates
            is due, `State.motion` is read.
        flags: Flags of the sample so far.
        decision: Result of `decide`.
        bandwidth: Cut-off frequency of the observers [Hz].

    Returns:
        All flags of the sample.
    """
    usable, touched, onset, base_settled, torque_settled, variance_ratio = decision
    track, stream, consistency = state.track, state.stream, state.consistency
    if not usable:
        end_contact(track)
        reset_friction_at_rest(state.friction_at_rest)
        return flags | SETTLING
    dt = stream.clock[0].step
    if consistency_is_due(consistency, dt):
        consistency_statistics(constants, state, variance_ratio)
    if update_consistency(consistency, state.statistics, touched, base_settled, torque_settled, dt):
        flags |= INCONSISTENT
    if touched:
        return flags | TOUCHED
    release_contact(track, dt)
    if onset:
        track.status[0].above_onset = True
    else:
        has_base, has_torque, _ = usable_sensors(stream)
        update_bias_filter(constants, state, has_base, has_torque, variance_ratio, bandwidth)
    return flags
