"""An arm in one posture: its state, and where its surface is."""

import numpy as np

from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.localization.surface.primitive_frames import place_primitives
from contactsense.runtime.state import State, empty_state
from contactsense.scene_model.constants import Constants


def placed(constants: Constants, q: np.ndarray) -> tuple[State, PlacedSurface]:
    """The arm at rest with joint positions q, shape (n,) [rad]."""
    state = empty_state(constants)
    kinematics_and_momenta(constants.model, q, np.zeros(len(q)), constants.gravity, state.motion)
    place_primitives(constants.surfaces, constants.sensors.depth, state.motion, state.frames)
    return state, PlacedSurface(constants.surfaces, constants.deviations, state.frames)
