"""All pairs of the coarse samples of the surface: the best ones as seeds, and their sum for each pair of
links."""

import math

import numpy as np

from contactsense.kinematics.exponential import exponential
from contactsense.multi_contact.buffers import DET, GAIN, NORMAL_FORCE, MeasurementRows, SeedingBuffers
from contactsense.multi_contact.link_information import fill_link_information, fill_sample_blocks, log_gain
from contactsense.multi_contact.pair_likelihood import (
    condition_on_first,
    fill_cross_information,
    likelihood_beside_first,
    take_first_contacts,
)
from contactsense.multi_contact.sample_likelihood import copy_lower, force_deviations
from contactsense.multi_contact.seed_list import find_slot, put_seed
from contactsense.multi_contact.seed_samples import SeedSamples
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES

NEGLIGIBLE = 20.0
"""Log evidence that is lower than another one by this does not count."""
LOWEST_EXPONENT = -40.0
"""Nor does exp of less than this."""


@fused_kernel
def seed_pairs(
    seed_samples: SeedSamples,
    friction_ratio: float,
    count: int,
    force_scale: float,
    rows: MeasurementRows,
    m: int,
    seeding: SeedingBuffers,
) -> None:
    """Every pair of the coarse samples: seeds of two contacts, or the beam for three."""
    chosen, evidence = seed_samples.coarse, seeding.pair_evidence
    scores, seeds = seeding.seed_score, seeding.seed
    if count > 2:
        scores, seeds = seeding.beam_score, seeding.beam
        scores[:] = -math.inf
    deviations = force_deviations(force_scale, friction_ratio)
    base = take_samples(seed_samples, force_scale, rows, m, seeding)
    fill_cross_information(m, seeding)
    evidence[:] = -math.inf
    seeding.pair_sum[:] = 0.0
    for b in range(chosen.link.shape[0]):
        own, link = chosen.link[b], -1
        take_first_contacts(b, own, deviations, seeding)
        for d in range(b + 1):
            if chosen.link[d] != link:
                link = chosen.link[d]
                condition_on_first(own, link, seeding)
            block = seeding.block[d]
            for j in range(chosen.filled[b]):
                lanes = chosen.filled[d] if d < b else j
                likelihood_beside_first(j, deviations, seeding.first, block)
                bound = base + _add_pair_evidence(block, lanes, evidence[own], seeding.pair_sum[own], link)
                if not bound > scores[-1]:
                    continue
                for e in range(lanes):
                    # The bound is cheaper than the score.
                    pushes = count > 2 or block[NORMAL_FORCE + e] > 0.0
                    if not (pushes and base + block[GAIN + e] > scores[-1]):
                        continue
                    score, samples = base + log_gain(block, e), (chosen.sample[b, j], chosen.sample[d, e], 0)
                    slot = find_slot(
                        seed_samples.primitive, seeding.point_normal, 2, score, samples, scores, seeds
                    )
                    if slot >= 0:
                        put_seed(score, samples, slot, scores, seeds)
    for k in range(evidence.shape[0]):
        for link in range(k + 1):
            if seeding.pair_sum[k, link] > 0.0:
                # The sum over samples is one over the surface.
                cells = seed_samples.spread[k] * seed_samples.spread[link]
                evidence[k, link] += base + math.log(seeding.pair_sum[k, link] * cells * cells)


@fused_kernel
def take_samples(
    seed_samples: SeedSamples, force_scale: float, rows: MeasurementRows, m: int, seeding: SeedingBuffers
) -> float:
    """Fill the blocks of samples, and what the measurement tells of a further contact on each link; the log
    likelihood without one."""
    for link in range(seed_samples.spread.shape[0]):
        seeding.moment_deviation[link] = force_scale * seed_samples.spread[link]
    fill_sample_blocks(seed_samples, seeding)
    copy_lower(m, seeding.prior_covariance, seeding.factor)
    return float(fill_link_information(rows, m, seeding))


@fused_kernel
def _add_pair_evidence(
    block: np.ndarray, lanes: int, reference: np.ndarray, total: np.ndarray, link: int
) -> float:
    """Add the likelihoods of pairs of one sample and the first `lanes` samples of a block to those of a link.

    Args:
        block: After `likelihood_beside_first`.
        lanes: Number of its samples.
        reference, total: The logarithm of the sum over all pairs is reference[link] + log(total[link]).
        link: That of the block.

    Returns:
        The largest `GAIN`, an upper bound of the log likelihoods.
    """
    largest = -math.inf
    for e in range(lanes):
        largest = max(largest, block[GAIN + e])
    if not largest > reference[link] - NEGLIGIBLE:
        return largest
    if largest > reference[link]:
        total[link] *= math.exp(reference[link] - largest)
        reference[link] = largest
    highest, added = reference[link], 0.0
    for e in range(LANES):
        part = exponential(max(block[GAIN + e] - highest, LOWEST_EXPONENT)) / math.sqrt(block[DET + e])
        added += part if e < lanes else 0.0
    total[link] += added
    return largest
