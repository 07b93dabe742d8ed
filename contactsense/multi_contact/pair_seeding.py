"""All pairs of the coarse samples of the surface: the best ones as seeds, and their sum for each pair of
links."""

import math

import numpy as np

from contactsense.kinematics.exponential import exponential
from contactsense.multi_contact.buffers import (
    DET,
    GAIN,
    NORMAL_FORCE,
    SIGNED_LIKELIHOOD,
    MeasurementRows,
    SeedingBuffers,
)
from contactsense.multi_contact.link_information import fill_link_information, fill_sample_blocks, log_gain
from contactsense.multi_contact.pair_likelihood import (
    LOWEST_EXPONENT,
    PairLikelihoods,
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

EXPONENTIAL_ERROR = 1e-3
"""More than twice the relative error of `contactsense.kinematics.exponential`."""


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
    chosen, gain = seed_samples.coarse, seeding.pair_gain
    scores, seeds = seeding.seed_score, seeding.seed
    if count > 2:
        scores, seeds = seeding.beam_score, seeding.beam
        scores[:] = -math.inf
    # Beside a third contact they may push after all.
    lowest_force = 0.0 if count == 2 else -math.inf
    deviations = force_deviations(force_scale, friction_ratio)
    base = take_samples(seed_samples, force_scale, rows, m, seeding)
    fill_cross_information(m, seeding)
    gain[:] = -math.inf
    seeding.pair_sum[:] = 0.0
    for b in range(chosen.link.shape[0]):
        own, link = chosen.link[b], -1
        take_first_contacts(b, own, deviations, seeding)
        for d in range(b + 1):
            if chosen.link[d] != link:
                link = chosen.link[d]
                condition_on_first(own, link, seeding)
            block = seeding.block[d]
            # The first sample of a block has none before it in the block.
            for j in range(0 if d < b else 1, chosen.filled[b]):
                lanes = chosen.filled[d] if d < b else j
                highest = gain[own, link]
                limit = _likelihood_limit(scores[-1] - base - highest)
                found = likelihood_beside_first(
                    j, lanes, deviations, highest, limit, lowest_force, seeding.first, block
                )
                _add_pair_evidence(found, block, lanes, gain[own], seeding.pair_sum[own], link)
                seeding.pair_reference[b, d, j] = gain[own, link] if found.near > 0 else -math.inf
                if found.near > 0:
                    likelihood = seeding.pair_likelihood[b, d, j]
                    for e in range(LANES):
                        likelihood[e] = block[SIGNED_LIKELIHOOD + e]
                if found.high == 0 and found.higher == 0:
                    continue
                for e in range(lanes):
                    # Cheaper than the score.
                    may_count = base + block[GAIN + e] > scores[-1]
                    if not (may_count and block[NORMAL_FORCE + e] > lowest_force):
                        continue
                    score, samples = base + log_gain(block, e), (chosen.sample[b, j], chosen.sample[d, e], 0)
                    slot = find_slot(
                        seed_samples.primitive, seeding.point_normal, 2, score, samples, scores, seeds
                    )
                    if slot >= 0:
                        put_seed(score, samples, slot, scores, seeds)
    seeding.pair_evidence[:] = -math.inf
    for k in range(gain.shape[0]):
        for link in range(k + 1):
            if seeding.pair_sum[k, link] > 0.0:
                # The sum over samples is one over the surface.
                cells = seed_samples.spread[k] * seed_samples.spread[link]
                seeding.pair_evidence[k, link] = (
                    base + gain[k, link] + math.log(seeding.pair_sum[k, link] * cells * cells)
                )


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
def _likelihood_limit(log_limit: float) -> float:
    """A likelihood that those with a logarithm above a limit exceed.

    It spares most logarithms of determinants, of which a score needs one.
    """
    if not log_limit > LOWEST_EXPONENT:
        return 0.0
    return float(exponential(log_limit) * (1.0 - EXPONENTIAL_ERROR))


@fused_kernel
def _add_pair_evidence(
    found: PairLikelihoods, block: np.ndarray, lanes: int, reference: np.ndarray, total: np.ndarray, link: int
) -> None:
    """Add the likelihoods of pairs of one sample and the first `lanes` samples of a block to those of a link.

    `SIGNED_LIKELIHOOD` becomes relative to the new `reference`.

    Args:
        found, block: After `likelihood_beside_first`.
        lanes: Number of its samples.
        reference, total: The logarithm of the sum over all pairs is reference[link] + log(total[link]).
        link: That of the block.
    """
    if found.higher > 0:
        highest, added = reference[link], 0.0
        for e in range(lanes):
            highest = max(highest, block[GAIN + e])
        for e in range(lanes):
            exponent = max(block[GAIN + e] - highest, LOWEST_EXPONENT)
            likelihood = exponential(exponent) / math.sqrt(block[DET + e])
            block[SIGNED_LIKELIHOOD + e] = math.copysign(likelihood, block[SIGNED_LIKELIHOOD + e])
            added += likelihood
        total[link] = total[link] * math.exp(reference[link] - highest) + added
        reference[link] = highest
    elif found.near > 0:
        total[link] += found.total
