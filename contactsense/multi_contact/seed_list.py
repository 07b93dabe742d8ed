"""Sorted list of the sets of surface samples at which the search for several contacts starts."""

import math

import numpy as np

from contactsense.robots.jit.kernel import fused_kernel

Samples = tuple[int, int, int]
"""Indices of the samples of a set; unused ones are 0."""
SAME_SIDE_COSINE = 0.9
"""Two samples are on the same side of a primitive if the cosine between their normals exceeds this."""


@fused_kernel
def _are_neighbours(primitives: np.ndarray, point_normal: np.ndarray, a: int, b: int) -> bool:
    """Whether two samples are on the same side of the same primitive: one optimization reaches both."""
    u, v = point_normal[a], point_normal[b]
    return bool(primitives[a] == primitives[b] and u[3] * v[3] + u[4] * v[4] + u[5] * v[5] > SAME_SIDE_COSINE)


@fused_kernel
def find_slot(
    primitives: np.ndarray,
    point_normal: np.ndarray,
    count: int,
    score: float,
    samples: Samples,
    scores: np.ndarray,
    seeds: np.ndarray,
) -> int:
    """Index of the seed that a set of `count` samples replaces in a list sorted by falling score.

    Of sets that differ in one sample only, on the same side of the same primitive, the list keeps the best.

    Returns:
        -1 if the score is not high enough.
    """
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
        similar = _are_neighbours(primitives, point_normal, x, a)
        if count > 1:
            similar = similar and _are_neighbours(primitives, point_normal, y, b)
        if count > 2:
            similar = similar and _are_neighbours(primitives, point_normal, z, c)
        if similar:
            return -1 if scores[i] >= score else i
    return last


@fused_kernel
def put_seed(score: float, samples: Samples, slot: int, scores: np.ndarray, seeds: np.ndarray) -> None:
    """Put a set of samples in the place of the seed in `slot`, and up to where its score belongs."""
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
