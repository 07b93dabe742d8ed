"""Sorted list of the sets of surface samples at which the search for several contacts starts."""

import math
from typing import NamedTuple

import numpy as np

from contactsense.robots.jit.kernel import fused_kernel

Samples = tuple[int, int, int]
"""Indices of the samples of a set; unused ones are 0."""
SAME_SIDE_COSINE = 0.9
"""Two samples are on the same side of a primitive if the cosine between their normals exceeds this."""


class SeedList(NamedTuple):
    """A list of sets of samples of one size, sorted by falling score."""

    size: int
    """Number of samples of a set, 1 to 3."""
    scores: np.ndarray
    """Log likelihood of each set, shape (L,); -infinity where there is none yet."""
    seeds: np.ndarray
    """Its samples, shape (L, MAX_CONTACTS), int64."""
    primitive: np.ndarray
    """Primitive of every sample of the surface, shape (N,), int64."""
    point_normal: np.ndarray
    """Points [m] and outward normals of the samples, base frame, shape (N, 6)."""


@fused_kernel
def _are_neighbours(found: SeedList, a: int, b: int) -> bool:
    """Whether two samples are on the same side of the same primitive: one optimization reaches both."""
    u, v = found.point_normal[a], found.point_normal[b]
    return bool(
        found.primitive[a] == found.primitive[b]
        and u[3] * v[3] + u[4] * v[4] + u[5] * v[5] > SAME_SIDE_COSINE
    )


@fused_kernel
def find_slot(found: SeedList, score: float, samples: Samples) -> int:
    """Index of the seed that a set of samples with this score replaces.

    Of sets that differ in one sample only, on the same side of the same primitive, the list keeps the best.

    Returns:
        -1 if the score is not high enough.
    """
    scores, seeds, count = found.scores, found.seeds, found.size
    last: int = scores.shape[0] - 1
    if not score > scores[last]:
        return -1
    a, b, c = samples
    for i in range(last + 1):
        if scores[i] == -math.inf:
            return i
        x, y, z = seeds[i, 0], seeds[i, 1], seeds[i, 2]
        differ = 1 if x != a else 0
        if count > 1:
            differ += 1 if y != b else 0
        if count > 2:
            differ += 1 if z != c else 0
        if differ > 1:
            continue
        similar = _are_neighbours(found, x, a)
        if count > 1:
            similar = similar and _are_neighbours(found, y, b)
        if count > 2:
            similar = similar and _are_neighbours(found, z, c)
        if similar:
            return -1 if scores[i] >= score else i
    return last


@fused_kernel
def put_seed(found: SeedList, score: float, samples: Samples, slot: int) -> None:
    """Put a set of samples in the place of the seed in `slot`, and up to where its score belongs."""
    scores, seeds = found.scores, found.seeds
    position = slot
    while position > 0 and scores[position - 1] < score:
        scores[position] = scores[position - 1]
        seeds[position, 0], seeds[position, 1], seeds[position, 2] = (
            seeds[position - 1, 0],
            seeds[position - 1, 1],
            seeds[position - 1, 2],
        )
        position -= 1
    scores[position] = score
    seeds[position, 0], seeds[position, 1], seeds[position, 2] = samples
