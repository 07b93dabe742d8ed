"""Surface samples in blocks for SIMD instructions, each with a sphere about it.

Most blocks are far from the line of action: the sphere tells, so that their samples are not looked at.
"""

import itertools
from typing import Annotated, NamedTuple

import numpy as np

from contactsense.localization.simd_layout import BOUND
from contactsense.localization.surface_samples import SurfaceSamples
from contactsense.robots.jit.declaration import Floats, Integers
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.surface.convex_primitives import Surfaces

CELL_REACH = 2.5
"""A cell reaches this many of its standard deviations from its sample: the corners of a square."""


class SurfaceBlocks(NamedTuple):
    """B blocks of up to `LANES` successive samples of one link."""

    cells: Annotated[Floats, f"blocks, {BOUND}"]
    """`X` to `SPREAD` of each sample as in `contactsense.localization.simd_layout`; the last sample repeated
    if a block is not full."""
    first: Annotated[Integers, "blocks"]
    """First sample of each block."""
    length: Annotated[Integers, "blocks"]
    """Number of samples in each."""
    centre: Annotated[Floats, "blocks, 3"]
    """Centre of the sphere, link frame [m]."""
    radius: Annotated[Floats, "blocks"]
    """Radius of a sphere about all cells of the block [m]."""
    start: Annotated[Integers, "links + 1"]
    """First block of each link, then the total number."""


def surface_blocks(surfaces: Surfaces, samples: SurfaceSamples) -> SurfaceBlocks:
    """The blocks of all samples."""
    ends = samples.start[surfaces.start]
    of_link = [np.arange(*link, LANES) for link in itertools.pairwise(ends)]
    first, counts = np.concatenate(of_link), [len(blocks) for blocks in of_link]
    start = np.concatenate(([0], np.cumsum(counts)))
    end = np.repeat(ends[1:], counts)
    rows = np.minimum(first[:, None] + np.arange(LANES), end[:, None] - 1)
    columns = np.column_stack((samples.point, samples.normal, samples.spread))
    point, spread = samples.point[rows], samples.spread[rows]
    centre = 0.5 * (point.min(axis=1) + point.max(axis=1))
    reach = np.linalg.norm(point - centre[:, None], axis=2) + CELL_REACH * spread
    return SurfaceBlocks(
        cells=columns[rows].transpose(0, 2, 1).reshape(len(first), -1),
        first=first.astype(np.int64),
        length=np.minimum(end - first, LANES).astype(np.int64),
        centre=centre,
        radius=reach.max(axis=1),
        start=start.astype(np.int64),
    )
