"""The state as it is before the first sample of a stream."""

import numpy as np

from contactsense.residuals.bias_filter import restart as restart_bias_filter
from contactsense.residuals.noise_scale import restart as restart_noise_scale
from contactsense.residuals.sensor_consistency import restart as restart_consistency
from contactsense.runtime.state import State
from contactsense.scene import Scene
from contactsense.scene_model.constants import Constants
from contactsense.sensors.stream_state import restart as restart_stream
from contactsense.tracking.contact_track import end_contact


def restart_state(scene: Scene, constants: Constants, state: State) -> None:
    """Forget what the samples of a stream have told: clock, biases, friction factors, masses, noise, and the
    contact. Numbers of contacts go on."""
    restart_stream(state.stream)
    state.stream.usable[:] = 0
    restart_consistency(state.consistency, scene.force, scene.contacts == 1)
    end_contact(state.track)
    for array, initial in zip(state.model, constants.model, strict=True):
        array[:] = initial
    state.torque_model.bias[:] = constants.torque_model.bias
    state.torque_model.friction_factor[:] = constants.torque_model.friction_factor
    weight = constants.model.mass[0] * np.append(
        constants.gravity, np.cross(constants.model.com[0], constants.gravity)
    )
    friction_error = constants.torque_model.friction_error
    restart_bias_filter(state.bias_filter, constants.inertia_error, weight, friction_error)
    restart_noise_scale(state.noise_scale, constants.sensors.base_covariance)
