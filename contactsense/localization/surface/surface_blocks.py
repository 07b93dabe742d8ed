"""Surface samples in compact blocks for SIMD instructions, each with a sphere about it.

Most blocks are far from the line of action: the sphere tells, so that their samples are not looked at.
"""

import itertools
import math
from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np

from contactsense.localization.surface.simd_layout import BOUND
from contactsense.localization.surface.surface_samples import SurfaceSamples
from contactsense.robots.jit.declaration import Floats, Integers
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.surface.convex_primitives import Surfaces

CELL_REACH = 2.5
"""A cell reaches this many of its standard deviations from its sample: the corners of a square."""


class SurfaceBlocks(NamedTuple):
    """B blocks of up to `LANES` samples of one link that are near each other."""

    cells: Annotated[Floats, f"blocks, {BOUND}"]
    """`X` to `TILT` of each sample as in `contactsense.localization.surface.simd_layout`; the last sample
    repeated if a block is not full."""
    sample: Annotated[Integers, f"blocks, {LANES}"]
    """The samples, the last one repeated."""
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
    of_link = [list(_halved(samples.point, np.arange(*link))) for link in itertools.pairwise(ends)]
    members = list(itertools.chain.from_iterable(of_link))
    start = np.concatenate(([0], np.cumsum([len(blocks) for blocks in of_link])))
    length = np.array([len(block) for block in members], dtype=np.int64)
    rows = np.array(
        [np.pad(block, (0, LANES - len(block)), mode="edge") for block in members], dtype=np.int64
    )
    rows = rows.reshape(-1, LANES)
    columns = np.column_stack((samples.point, samples.normal, samples.spread, samples.tilt))
    point, spread = samples.point[rows], samples.spread[rows]
    centre = 0.5 * (point.min(axis=1) + point.max(axis=1))
    reach = np.linalg.norm(point - centre[:, None], axis=2) + CELL_REACH * spread
    return SurfaceBlocks(
        cells=columns[rows].transpose(0, 2, 1).reshape(len(rows), -1),
        sample=rows,
        length=length,
        centre=centre,
        radius=reach.max(axis=1),
        start=start.astype(np.int64),
    )


def _halved(points: np.ndarray, members: np.ndarray) -> Iterator[np.ndarray]:
    """Blocks of up to `LANES` of the members: each set is divided where it is longest, into two of about the
    same number of full blocks."""
    if len(members) <= LANES:
        if len(members):
            yield members
        return
    own = points[members]
    order = members[np.argsort(own[:, np.ptp(own, axis=0).argmax()], kind="stable")]
    half = LANES * (math.ceil(len(members) / LANES) // 2)
    yield from _halved(points, order[:half])
    yield from _halved(points, order[half:])
