"""The surface of the arm in one posture: where a contact may be."""

from typing import NamedTuple

from contactsense.localization.surface.local_prior import DeviationCells
from contactsense.localization.surface.primitive_frames import PrimitiveFrames
from contactsense.robots.surface.convex_primitives import Surfaces


class PlacedSurface(NamedTuple):
    """The surface of the arm in the posture of one measurement."""

    surfaces: Surfaces
    """Primitives, in the frames of their links."""
    deviations: DeviationCells
    """How far the real surface is from them, place by place."""
    frames: PrimitiveFrames
    """Their body frames in the base frame, filled by
    `contactsense.localization.surface.primitive_frames.place_primitives`."""
