"""What the searches for a contact share: the scene's surface, and their arrays."""

from typing import NamedTuple

import numpy as np

from contactsense.localization.candidates.candidate_buffers import Candidates
from contactsense.localization.problem.surface_cells import SurfaceCells
from contactsense.localization.surface.local_prior import DeviationCells
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.localization.surface.primitive_frames import PrimitiveFrames
from contactsense.localization.surface.surface_blocks import SurfaceBlocks
from contactsense.localization.surface.surface_moments import SurfaceMoments
from contactsense.localization.surface.surface_samples import SurfaceSamples, SurfaceSubsamples
from contactsense.robots.jit.kernel import inlined_fused_kernel
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.solvers.posterior.contact_prior import SearchBuffers


class SearchedSurface(NamedTuple):
    """The surface of a scene, as it is searched."""

    surfaces: Surfaces
    """Primitives in the frames of their links."""
    samples: SurfaceSamples
    """Samples of their surface."""
    blocks: SurfaceBlocks
    """The samples in blocks."""
    subsamples: SurfaceSubsamples
    """Subsamples of each sample's surface cell."""
    deviations: DeviationCells
    """How far the real surface is from the primitives, place by place."""
    touchable: np.ndarray
    """1 for links that can be touched in the scene, else 0, shape (links,), int64. A touch on another link is
    "none of these"."""
    left_out: SurfaceMoments
    """Surfaces of those others, where they can be touched."""
    unmodelled: SurfaceMoments
    """Places of the searched links that the primitives do not model."""
    depth: np.ndarray
    """Number of joints between the base and each link, shape (links,), int64."""


class SearchArrays(NamedTuple):
    """Arrays that a search fills."""

    buffers: SearchBuffers
    """Scratch of the search on one primitive."""
    cells: SurfaceCells
    """Scratch of the search over the surface."""
    candidates: Candidates
    """The candidates found."""
    frames: PrimitiveFrames
    """Body frames of all primitives in the posture of the measurement."""


@inlined_fused_kernel
def placed_surface(scene: SearchedSurface, arrays: SearchArrays) -> PlacedSurface:
    """Where the surface is, once `arrays.frames` are filled."""
    return PlacedSurface(scene.surfaces, scene.deviations, arrays.frames)
