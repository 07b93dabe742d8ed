"""Seeds of the search for several contacts: the sets of surface samples that explain a measurement best."""

import math

import numpy as np

from contactsense.localization.simd_layout import LANES
from contactsense.multi_contact.buffers import (
    DET,
    GAIN,
    NORMAL_FORCE,
    SPREAD,
    MeasurementRows,
    SeedingBuffers,
)
from contactsense.multi_contact.link_information import (
    fill_link_information,
    fill_sample_blocks,
    likelihood_near_samples,
    log_gain,
    log_likelihood,
)
from contactsense.multi_contact.sample_likelihood import (
    add_sample_covariance,
    copy_lower,
    force_deviations,
    is_pushing,
    weight_innovation,
)
from contactsense.multi_contact.seed_samples import SeedSamples
from contactsense.robots.jit.kernel import fused_kernel

Samples = tuple[int, int, int]
"""Indices of the samples of a set; unused ones are 0."""
NEGLIGIBLE = 20.0
"""Log evidence that is lower than another one by this does not count."""
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
        _seed_singles(seed_samples, friction_ratio, force_scale, rows, m, seeding)
    else:
        _seed_pairs(seed_samples, friction_ratio, count, force_scale, rows, m, seeding)
    if count == 3:
        _seed_triples(seed_samples, friction_ratio, force_scale, rows, m, seeding)
    found = 0
    while found < seeding.seed_score.shape[0] and seeding.seed_score[found] > -math.inf:
        found += 1
    return found


@fused_kernel
def _seed_singles(
    seed_samples: SeedSamples,
    friction_ratio: float,
    force_scale: float,
    rows: MeasurementRows,
    m: int,
    seeding: SeedingBuffers,
) -> None:
    """Every coarse sample: seeds of one contact beside known ones."""
    chosen, scores, seeds = seed_samples.coarse, seeding.seed_score, seeding.seed
    fill_sample_blocks(seed_samples, force_scale * seed_samples.coarse_factor, seeding)
    deviations = force_deviations(force_scale, friction_ratio)
    copy_lower(m, seeding.prior_covariance, seeding.factor)
    base = fill_link_information(rows, m, seeding)
    for d in range(chosen.link.shape[0]):
        block, link = seeding.block[d], chosen.link[d]
        likelihood_near_samples(seeding.link_information[link], seeding.link_vector[link], deviations, block)
        for e in range(chosen.filled[d]):
            if not (block[NORMAL_FORCE + e] > 0.0 and base + block[GAIN + e] > scores[-1]):
                continue
            score, samples = base + log_gain(block, e), (chosen.sample[d, e], 0, 0)
            slot = find_slot(seed_samples.primitive, seeding.point_normal, 1, score, samples, scores, seeds)
            if slot >= 0:
                put_seed(score, samples, slot, scores, seeds)


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
    chosen = seed_samples.coarse
    scores, seeds = seeding.seed_score, seeding.seed
    if count > 2:
        scores, seeds = seeding.beam_score, seeding.beam
        scores[:] = -math.inf
    fill_sample_blocks(seed_samples, force_scale * seed_samples.coarse_factor, seeding)
    deviations = force_deviations(force_scale, friction_ratio)
    seeding.pair_evidence[:] = -math.inf
    for b in range(chosen.link.shape[0]):
        own = chosen.link[b]
        for j in range(chosen.filled[b]):
            i, S = chosen.sample[b, j], seeding.contact_covariance[b * LANES + j]
            for r in range(m):
                for s in range(r + 1):
                    S[r, s] = 0.0
            add_sample_covariance(
                seed_samples, friction_ratio, i, seed_samples.coarse_factor, force_scale, rows, m, seeding, S
            )
            _sum(m, seeding.prior_covariance, S, seeding.given_covariance)
            copy_lower(m, seeding.given_covariance, seeding.factor)
            base = fill_link_information(rows, m, seeding)
            for d in range(b + 1):
                block, link = seeding.block[d], chosen.link[d]
                likelihood_near_samples(
                    seeding.link_information[link], seeding.link_vector[link], deviations, block
                )
                lanes = chosen.filled[d] if d < b else j
                _add_pair_evidence(
                    base + 2.0 * math.log(seed_samples.spread[i]),
                    block,
                    lanes,
                    seeding.pair_evidence[own],
                    link,
                )
                for e in range(lanes):
                    # The bound is cheaper than the score.
                    pushes = count > 2 or block[NORMAL_FORCE + e] > 0.0
                    if not (pushes and base + block[GAIN + e] > scores[-1]):
                        continue
                    k, score = chosen.sample[d, e], base + log_gain(block, e)
                    samples = (i, k, 0)
                    slot = find_slot(
                        seed_samples.primitive, seeding.point_normal, 2, score, samples, scores, seeds
                    )
                    if slot >= 0 and (count > 2 or _all_push(m, d * LANES + e, (i, k, k), seeding)):
                        put_seed(score, samples, slot, scores, seeds)


@fused_kernel
def _add_pair_evidence(base: float, block: np.ndarray, lanes: int, evidence: np.ndarray, link: int) -> None:
    """Add the evidence of pairs of one sample and the first `lanes` samples of a block to `evidence[link]`.

    A sample counts in proportion to the area of its cell, the square of its spread. `base`: log evidence of
    the one sample.
    """
    largest = -math.inf
    for e in range(lanes):
        largest = max(largest, block[GAIN + e])
    # A gain is an upper bound of a log likelihood: nothing is added by what is far below.
    if not base + largest > evidence[link] - NEGLIGIBLE:
        return
    total = 0.0
    for e in range(lanes):
        area = block[SPREAD + e] * block[SPREAD + e]
        total += area * math.exp(block[GAIN + e] - largest) / math.sqrt(block[DET + e])
    added = base + largest + math.log(total)
    high, low = max(added, evidence[link]), min(added, evidence[link])
    evidence[link] = high + math.log1p(math.exp(low - high))


@fused_kernel
def _seed_triples(
    seed_samples: SeedSamples,
    friction_ratio: float,
    force_scale: float,
    rows: MeasurementRows,
    m: int,
    seeding: SeedingBuffers,
) -> None:
    """The pairs of the beam, each extended by every coarse sample, after `_seed_pairs`."""
    chosen, scores = seed_samples.coarse, seeding.seed_score
    deviations = force_deviations(force_scale, friction_ratio)
    for t in range(seeding.beam_score.shape[0]):
        if seeding.beam_score[t] == -math.inf:
            break
        i, k = seeding.beam[t, 0], seeding.beam[t, 1]
        copy_lower(m, seeding.prior_covariance, seeding.given_covariance)
        for s in (i, k):
            add_sample_covariance(
                seed_samples, friction_ratio, s, seed_samples.coarse_factor, force_scale, rows, m, seeding,
                seeding.given_covariance,
            )  # fmt: skip
        copy_lower(m, seeding.given_covariance, seeding.factor)
        base = fill_link_information(rows, m, seeding)
        for d in range(chosen.link.shape[0]):
            block, link = seeding.block[d], chosen.link[d]
            likelihood_near_samples(
                seeding.link_information[link], seeding.link_vector[link], deviations, block
            )
            for e in range(chosen.filled[d]):
                j = chosen.sample[d, e]
                if j == i or j == k:  # noqa: SIM109 (a tuple would be searched slower)
                    continue
                if not (block[NORMAL_FORCE + e] > 0.0 and base + block[GAIN + e] > scores[-1]):
                    continue
                # In a fixed order, so that permutations are one seed.
                a, c = max(i, max(k, j)), min(i, min(k, j))
                score, samples = base + log_gain(block, e), (a, i + k + j - a - c, c)
                slot = find_slot(
                    seed_samples.primitive, seeding.point_normal, 3, score, samples, scores, seeding.seed
                )
                if slot >= 0 and _all_push(m, d * LANES + e, (i, k, j), seeding):
                    put_seed(score, samples, slot, scores, seeding.seed)


@fused_kernel
def _all_push(m: int, last: int, samples: tuple[int, int, int], seeding: SeedingBuffers) -> bool:
    """Whether the most likely forces at all these samples push, given the covariance of all but the last.

    `last`: index of the last one in `seeding.contact_covariance`.
    """
    _sum(m, seeding.given_covariance, seeding.contact_covariance[last], seeding.factor)
    log_likelihood(m, seeding)
    weight_innovation(m, seeding)
    i, j, k = samples
    return bool(is_pushing(m, seeding, i) and is_pushing(m, seeding, j) and is_pushing(m, seeding, k))


@fused_kernel
def _sum(m: int, a: np.ndarray, b: np.ndarray, out: np.ndarray) -> None:
    for r in range(m):
        for s in range(r + 1):
            out[r, s] = a[r, s] + b[r, s]
