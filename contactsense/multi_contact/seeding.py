"""Seeds of the search for several contacts: the sets of surface samples that explain a measurement best."""

import math

import numpy as np

from contactsense.multi_contact.buffers import MeasurementRows, SeedingBuffers
from contactsense.multi_contact.sample_likelihood import (
    add_sample_covariance,
    copy_lower,
    is_pushing,
    log_likelihood,
    weight_innovation,
)
from contactsense.multi_contact.seed_samples import SeedSamples
from contactsense.robots.jit.kernel import fused_kernel

SAME_SIDE_COSINE = 0.9
"""Two samples are on the same side of a primitive if the cosine between their normals exceeds this."""


@fused_kernel
def _are_neighbours(primitives: np.ndarray, point_normal: np.ndarray, a: int, b: int) -> bool:
    """Whether two samples are on the same side of the same primitive: one optimization reaches both."""
    u, v = point_normal[a], point_normal[b]
    return bool(primitives[a] == primitives[b] and u[3] * v[3] + u[4] * v[4] + u[5] * v[5] > SAME_SIDE_COSINE)


@fused_kernel
def insert_seed(
    primitives: np.ndarray,
    point_normal: np.ndarray,
    count: int,
    score: float,
    a: int,
    b: int,
    c: int,
    scores: np.ndarray,
    seeds: np.ndarray,
) -> None:
    """Insert a set of `count` samples into a list sorted by falling score, if its score is high enough.

    Of sets that differ in one sample only, on the same side of the same primitive, the list keeps the
    best.
    """
    last = scores.shape[0] - 1
    if not score > scores[last]:
        return
    replaced = last
    for i in range(last + 1):
        if scores[i] == -math.inf:
            break
        x, y, z = seeds[i, 0], seeds[i, 1], seeds[i, 2]
        similar = _are_neighbours(primitives, point_normal, x, a)
        differ = 1 if x != a else 0
        if count > 1:
            similar = similar and _are_neighbours(primitives, point_normal, y, b)
            differ += 1 if y != b else 0
        if count > 2:
            similar = similar and _are_neighbours(primitives, point_normal, z, c)
            differ += 1 if z != c else 0
        if similar and differ <= 1:
            if scores[i] >= score:
                return
            replaced = i
            break
    position = replaced
    while position > 0 and scores[position - 1] < score:
        scores[position] = scores[position - 1]
        seeds[position, 0], seeds[position, 1], seeds[position, 2] = (
            seeds[position - 1, 0],
            seeds[position - 1, 1],
            seeds[position - 1, 2],
        )
        position -= 1
    scores[position] = score
    seeds[position, 0], seeds[position, 1], seeds[position, 2] = a, b, c


@fused_kernel
def find_seeds(
    seed_samples: SeedSamples,
    friction_ratio: float,
    count: int,
    force_scale: float,
    rows: MeasurementRows,
    m: int,
    seeding: SeedingBuffers,
) -> int:
    """Fill `seeding.seed` with the sets of `count` (1 to 3) samples that explain the innovation best.

    Args:
        seed_samples: The samples.
        friction_ratio: That of the prior.
        count: Number of further contacts.
        force_scale: Approximate magnitude of the forces [N].
        rows, m: The measurement and the number of its rows.
        seeding: After `transform_samples` and `initialize_seeding`.

    Returns:
        Number of seeds.
    """
    seeding.seed_score[:] = -math.inf
    if count == 1:
        _seed_single(seed_samples, friction_ratio, force_scale, rows, m, seeding)
    else:
        _seed_pairs(seed_samples, friction_ratio, count, force_scale, rows, m, seeding)
    if count == 3:
        _seed_triples(seed_samples, m, seeding)
    found = 0
    while found < seeding.seed_score.shape[0] and seeding.seed_score[found] > -math.inf:
        found += 1
    return found


@fused_kernel
def _seed_single(
    seed_samples: SeedSamples,
    friction_ratio: float,
    force_scale: float,
    rows: MeasurementRows,
    m: int,
    seeding: SeedingBuffers,
) -> None:
    """Every sample, for one further contact."""
    for i in range(seed_samples.primitive.shape[0]):
        copy_lower(m, seeding.prior_covariance, seeding.factor)
        add_sample_covariance(
            seed_samples, friction_ratio, i, 1.0, force_scale, rows, m, seeding, seeding.factor
        )
        score = log_likelihood(m, seeding)
        if score > seeding.seed_score[-1]:
            weight_innovation(m, seeding)
            if is_pushing(m, seeding, i):
                insert_seed(
                    seed_samples.primitive,
                    seeding.point_normal,
                    1,
                    score,
                    i,
                    0,
                    0,
                    seeding.seed_score,
                    seeding.seed,
                )


@fused_kernel
def _seed_pairs(
    seed_samples: SeedSamples,
    friction_ratio: float,
    count: int,
    force_scale: float,
    rows: MeasurementRows,
    m: int,
    seeding: SeedingBuffers,
) -> None:
    """Every pair of the coarse samples: seeds of two contacts, or the beam for three."""
    seeding.beam_score[:] = -math.inf
    for e in range(seed_samples.coarse.shape[0]):
        i, S = seed_samples.coarse[e], seeding.contact_covariance[e]
        for r in range(m):
            for s in range(r + 1):
                S[r, s] = 0.0
        add_sample_covariance(
            seed_samples, friction_ratio, i, seed_samples.coarse_factor, force_scale, rows, m, seeding, S
        )
        _sum(m, seeding.prior_covariance, S, seeding.pair_covariance)
        for d in range(e):
            k = seed_samples.coarse[d]
            _sum(m, seeding.pair_covariance, seeding.contact_covariance[d], seeding.factor)
            score = log_likelihood(m, seeding)
            if count > 2:
                insert_seed(
                    seed_samples.primitive,
                    seeding.point_normal,
                    2,
                    score,
                    i,
                    k,
                    0,
                    seeding.beam_score,
                    seeding.beam,
                )
            elif score > seeding.seed_score[-1]:
                weight_innovation(m, seeding)
                if is_pushing(m, seeding, i) and is_pushing(m, seeding, k):
                    insert_seed(
                        seed_samples.primitive,
                        seeding.point_normal,
                        2,
                        score,
                        i,
                        k,
                        0,
                        seeding.seed_score,
                        seeding.seed,
                    )


@fused_kernel
def _seed_triples(seed_samples: SeedSamples, m: int, seeding: SeedingBuffers) -> None:
    """The pairs of the beam, each extended by every coarse sample."""
    for t in range(seeding.beam_score.shape[0]):
        if seeding.beam_score[t] == -math.inf:
            break
        i, k = seeding.beam[t, 0], seeding.beam[t, 1]
        copy_lower(m, seeding.prior_covariance, seeding.pair_covariance)
        for e in range(seed_samples.coarse.shape[0]):
            if seed_samples.coarse[e] == i or seed_samples.coarse[e] == k:
                _sum(m, seeding.pair_covariance, seeding.contact_covariance[e], seeding.pair_covariance)
        for e in range(seed_samples.coarse.shape[0]):
            j = seed_samples.coarse[e]
            if j == i or j == k:  # noqa: SIM109 (a tuple would be searched slower)
                continue
            _sum(m, seeding.pair_covariance, seeding.contact_covariance[e], seeding.factor)
            score = log_likelihood(m, seeding)
            if score > seeding.seed_score[-1]:
                weight_innovation(m, seeding)
                if is_pushing(m, seeding, i) and is_pushing(m, seeding, k) and is_pushing(m, seeding, j):
                    # In a fixed order, so that permutations are one seed.
                    a, c = max(i, max(k, j)), min(i, min(k, j))
                    b = i + k + j - a - c
                    insert_seed(
                        seed_samples.primitive,
                        seeding.point_normal,
                        3,
                        score,
                        a,
                        b,
                        c,
                        seeding.seed_score,
                        seeding.seed,
                    )


@fused_kernel
def _sum(m: int, a: np.ndarray, b: np.ndarray, out: np.ndarray) -> None:
    for r in range(m):
        for s in range(r + 1):
            out[r, s] = a[r, s] + b[r, s]
