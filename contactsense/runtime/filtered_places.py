"""With joint torques alone: candidates from all samples since the onset of a contact."""

from contactsense.robots.jit.kernel import kernel
from contactsense.runtime.constants import Constants
from contactsense.runtime.state import State
from contactsense.sensors.stream_state import TORQUE
from contactsense.tracking.place_candidates import list_places, score_places
from contactsense.tracking.place_filter import add_sample, end_block, start_filter


@kernel
def follow_places(constants: Constants, state: State, count: int, bandwidth: float) -> int:
    """Update the filter of the place by the newest sample of a contact, and replace the candidates that
    `contactsense.runtime.explanation.explain` has found by those of the filter.

    Args:
        constants: The scene's constants.
        state: After `explain` for this sample. `places` is changed, and once the filter has completed a block
            `candidates` and `link_probability` are, too.
        count: Number of candidates that `explain` has found.
        bandwidth: Cut-off frequency of the observers [Hz].

    Returns:
        Number of candidates.
    """
    places, samples, surfaces = state.places, constants.samples, constants.surfaces
    prior, depth, residual = constants.prior, constants.sensors.depth, state.observers.joints.residual
    track, status, dt = state.track, places.status[0], state.stream.steps[TORQUE]
    scale, noise, error = state.noise_scale.noise[TORQUE].scale, places.noise, places.model_error
    for j in range(noise.shape[0]):
        noise[j] = constants.sensors.torque_variance[j] * scale
        error[j] = (
            state.unmodelled_std[j] ** 2
            + state.timing_error.variance[j]
            + state.bias_filter.torque_variance[j]
        )
    if status.contact != track.status[0].number or track.status[0].age == 0.0 or dt == 0.0:
        for j in range(noise.shape[0]):
            noise[j] = noise[j] * track.variance_ratio[0] + error[j]
        start_filter(
            places, samples, surfaces.link, depth, state.motion, residual, noise, prior, state.search_buffers
        )
        status.contact = track.status[0].number
    elif dt > 0.0 and add_sample(places, depth, state.motion, residual, dt, bandwidth):
        if end_block(places, samples, surfaces.link, depth, noise, error, prior, state.search_buffers):
            score_places(places, samples, surfaces, depth, state.motion, state.candidates, prior)
        else:
            # Another contact than before: start again with the next sample.
            status.contact, status.blocks = 0, 0
    if count == 0 or status.blocks == 0:
        return count
    listed: int = list_places(
        places, samples, surfaces, depth, state.motion, state.candidates, prior, state.link_probability
    )
    return listed
