"""Selects the surface samples at which the search for several contacts starts."""

from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np

from contactsense.robots.jit.declaration import Floats, Integers
from contactsense.robots.jit.lanes import LANES
from contactsense.scene_model.constants import Constants

MAX_SEED_SAMPLES = 160
"""Number of samples of which pairs are formed."""
NORMAL_WEIGHT = 0.03
"""Distance that corresponds to a turn of the normal by one radian in the selection [m]."""


class SampleBlocks(NamedTuple):
    """Samples in blocks of `LANES`, each block on one link, for SIMD instructions."""

    sample: Annotated[Integers, f"blocks, {LANES}"]
    """Indices of the samples; the last one of a block fills its unused lanes."""
    link: Annotated[Integers, "blocks"]
    """Link of each block."""
    filled: Annotated[Integers, "blocks"]
    """Number of samples in each block."""


class SeedSamples(NamedTuple):
    """The samples of `contactsense.localization.surface.surface_samples`, and a coarse subset that covers the
    arm."""

    primitive: Annotated[Integers, "samples"]
    """Primitive of every sample."""
    link: Annotated[Integers, "samples"]
    """Its link."""
    spread: Annotated[Floats, "links"]
    """Standard deviation along each tangent of the cell of a coarse sample, by link [m]: all share the area
    of their link equally."""
    coarse: SampleBlocks
    """The coarse subset, at most MAX_SEED_SAMPLES."""


def choose_seed_samples(constants: Constants) -> SeedSamples:
    """Select the subset by farthest-point sampling."""
    samples = constants.samples
    link = constants.surfaces.link[samples.primitive]
    features = np.column_stack((samples.point, NORMAL_WEIGHT * samples.normal, 10.0 * link))
    nearest = np.full(len(features), np.inf)
    coarse: list[int] = []
    for _ in range(min(MAX_SEED_SAMPLES, len(features))):
        coarse.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, np.linalg.norm(features - features[coarse[-1]], axis=1))
    # The square of a spread is in proportion to the area.
    links = len(constants.touchable)
    area = np.bincount(link, samples.spread**2, minlength=links)
    cells = np.maximum(np.bincount(link[coarse], minlength=links), 1)
    return SeedSamples(samples.primitive.copy(), link.copy(), np.sqrt(area / cells), in_blocks(coarse, link))


def in_blocks(chosen: Sequence[int], link: np.ndarray) -> SampleBlocks:
    """Blocks of the chosen samples, in order of their links; `link`: that of every sample."""
    sample, of_block, filled = [], [], []
    for k in np.unique(link[list(chosen)]):
        own = [i for i in chosen if link[i] == k]
        for first in range(0, len(own), LANES):
            block = own[first : first + LANES]
            sample.append(block + [block[-1]] * (LANES - len(block)))
            of_block.append(k)
            filled.append(len(block))
    return SampleBlocks(
        np.array(sample, dtype=np.int64).reshape(-1, LANES),
        np.array(of_block, dtype=np.int64),
        np.array(filled, dtype=np.int64),
    )
