"""Seeds of the search for several contacts: the sets of surface samples that explain a measurement best."""

import math

import numpy as np

from contactsense.localization.candidates.candidate_buffers import Candidates
from contactsense.multi_contact.likelihood.link_information import (
    fill_link_information,
    likelihood_near_samples,
    log_gain,
    log_likelihood,
)
from contactsense.multi_contact.likelihood.sample_likelihood import (
    SampleModel,
    add_sample_covariance,
    copy_lower,
    force_deviations,
    is_pushing,
    weight_innovation,
)
from contactsense.multi_contact.memory.buffers import SeedingBuffers
from contactsense.multi_contact.memory.sample_layout import GAIN, NORMAL_FORCE
from contactsense.multi_contact.memory.seed_samples import SampleBlocks
from contactsense.multi_contact.seeding.pair_seeding import seed_pairs, take_samples
from contactsense.multi_contact.seeding.seed_list import SAME_SIDE_COSINE, SeedList, find_slot, put_seed
from contactsense.robots.jit.kernel import fused_kernel, inlined_fused_kernel
from contactsense.robots.jit.lanes import LANES


@fused_kernel
def find_seeds(model: SampleModel, count: int, seeding: SeedingBuffers) -> int:
    """Fill `seeding.seed` with the sets of `count` (1 to 3) samples that explain the innovation best.

    Args:
        model: The samples and the measurement.
        count: Number of further contacts.
        seeding: After `transform_samples` and `initialize_seeding`.

    Returns:
        Number of seeds.
    """
    seeding.seed_score[:] = -math.inf
    if count == 1:
        _seed_singles(model, seeding)
    else:
        seed_pairs(model, count, seeding)
    if count == 3:
        _seed_triples(model, seeding)
    found = 0
    while found < seeding.seed_score.shape[0] and seeding.seed_score[found] > -math.inf:
        found += 1
    return found


@fused_kernel
def drop_seeds_at_candidates(
    primitives: np.ndarray, candidates: Candidates, candidates_used: int, seeding: SeedingBuffers, found: int
) -> int:
    """Drop the seeds of one contact on the same side of the same primitive as one of the most probable
    candidates, from which another optimization starts; returns how many of the `found` ones remain."""
    kept = 0
    for s in range(found):
        i, near = seeding.seed[s, 0], False
        for k in range(candidates_used):
            row = candidates.order[k]
            n, v = candidates.normal[row], seeding.point_normal[i]
            cosine = n[0] * v[3] + n[1] * v[4] + n[2] * v[5]
            near = near or (candidates.primitive[row] == primitives[i] and cosine > SAME_SIDE_COSINE)
        if not near:
            seeding.seed[kept, 0] = i
            kept += 1
    return kept


@inlined_fused_kernel
def _likelihood_in_block(
    chosen: SampleBlocks, d: int, deviations: tuple[float, float], seeding: SeedingBuffers
) -> None:
    """Likelihood of a contact near each sample of block d; `deviations`: of its force along the normal and
    along the tangents [N]."""
    link = chosen.link[d]
    likelihood_near_samples(
        seeding.link_information[link],
        seeding.link_vector[link],
        deviations,
        seeding.moment_deviation[link],
        seeding.block[d],
    )


@fused_kernel
def _seed_singles(model: SampleModel, seeding: SeedingBuffers) -> None:
    """Every coarse sample: seeds of one contact beside known ones."""
    seed_samples = model.samples
    chosen, scores = seed_samples.coarse, seeding.seed_score
    found = SeedList(1, scores, seeding.seed, seed_samples.primitive, seeding.point_normal)
    deviations = force_deviations(model.force_scale, model.friction_ratio)
    base = take_samples(model, seeding)
    for d in range(chosen.link.shape[0]):
        block = seeding.block[d]
        _likelihood_in_block(chosen, d, deviations, seeding)
        for e in range(chosen.filled[d]):
            if not (block[NORMAL_FORCE + e] > 0.0 and base + block[GAIN + e] > scores[-1]):
                continue
            score, samples = base + log_gain(block, e), (chosen.sample[d, e], 0, 0)
            slot = find_slot(found, score, samples)
            if slot >= 0:
                put_seed(found, score, samples, slot)


@fused_kernel
def _seed_triples(model: SampleModel, seeding: SeedingBuffers) -> None:
    """The pairs of the beam, each extended by every coarse sample, after `seed_pairs`."""
    seed_samples, (_, m) = model.samples, model.measurement
    chosen, scores = seed_samples.coarse, seeding.seed_score
    found = SeedList(3, scores, seeding.seed, seed_samples.primitive, seeding.point_normal)
    deviations = force_deviations(model.force_scale, model.friction_ratio)
    _fill_contact_covariances(model, seeding)
    for t in range(seeding.beam_score.shape[0]):
        if seeding.beam_score[t] == -math.inf:
            break
        i, k = seeding.beam[t, 0], seeding.beam[t, 1]
        copy_lower(m, seeding.prior_covariance, seeding.given_covariance)
        for s in (i, k):
            add_sample_covariance(model, s, seeding, seeding.given_covariance)
        copy_lower(m, seeding.given_covariance, seeding.factor)
        base = fill_link_information(model.measurement, seeding)
        for d in range(chosen.link.shape[0]):
            block = seeding.block[d]
            _likelihood_in_block(chosen, d, deviations, seeding)
            for e in range(chosen.filled[d]):
                j = chosen.sample[d, e]
                if j == i or j == k:  # noqa: SIM109 (a tuple would be searched slower)
                    continue
                if not (block[NORMAL_FORCE + e] > 0.0 and base + block[GAIN + e] > scores[-1]):
                    continue
                # In a fixed order, so that permutations are one seed.
                a, c = max(i, max(k, j)), min(i, min(k, j))
                score, samples = base + log_gain(block, e), (a, i + k + j - a - c, c)
                slot = find_slot(found, score, samples)
                if slot >= 0 and _all_push(m, d * LANES + e, (i, k, j), seeding):
                    put_seed(found, score, samples, slot)


@fused_kernel
def _fill_contact_covariances(model: SampleModel, seeding: SeedingBuffers) -> None:
    """Fill the covariance of the measurement that a contact at each coarse sample causes."""
    chosen, (_, m) = model.samples.coarse, model.measurement
    for d in range(chosen.link.shape[0]):
        for e in range(chosen.filled[d]):
            S = seeding.contact_covariance[d * LANES + e]
            for r in range(m):
                for s in range(r + 1):
                    S[r, s] = 0.0
            add_sample_covariance(model, chosen.sample[d, e], seeding, S)


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
