"""All pairs of the coarse samples of the surface: the best ones as seeds, and their sum for each pair of
links."""

import math

import numpy as np

from contactsense.kinematics.exponential import exponential
from contactsense.multi_contact.likelihood.link_information import fill_link_information, fill_sample_blocks
from contactsense.multi_contact.likelihood.pair_likelihood import (
    condition_on_first,
    fill_cross_information,
    fill_pair_likelihoods,
    take_first_contacts,
)
from contactsense.multi_contact.likelihood.sample_likelihood import SampleModel, copy_lower, force_deviations
from contactsense.multi_contact.memory.buffers import SeedingBuffers
from contactsense.multi_contact.memory.pair_layout import PAIR_DET, PAIR_FORCE, PAIR_GAIN, PAIRS
from contactsense.multi_contact.seeding.seed_list import SeedList, find_slot, put_seed
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES

NEGLIGIBLE = 20.0
"""Log likelihood that is lower than another one on the same links by this does not count."""
LOWEST_EXPONENT = -40.0
"""Nor does exp of less than this."""


@fused_kernel
def seed_pairs(model: SampleModel, count: int, seeding: SeedingBuffers) -> None:
    """Every pair of the coarse samples: seeds of two contacts, or the beam for three."""
    seed_samples = model.samples
    chosen, gain = seed_samples.coarse, seeding.pair_gain
    # Beside a third contact they may push after all.
    lowest_force = 0.0 if count == 2 else -math.inf
    deviations = force_deviations(model.force_scale, model.friction_ratio)
    base = take_samples(model, seeding)
    fill_cross_information(model.measurement.size, seeding)
    gain[:] = -math.inf
    seeding.pair_sum[:] = 0.0
    for b in range(chosen.link.shape[0]):
        own, link = chosen.link[b], -1
        take_first_contacts(b, own, deviations, seeding)
        for d in range(b + 1):
            if chosen.link[d] != link:
                link = chosen.link[d]
                condition_on_first(own, link, seeding)
            highest = fill_pair_likelihoods(
                chosen.filled[b], chosen.filled[d] if d < b else 0, deviations, seeding.first,
                seeding.block[d], seeding.pair,
            )  # fmt: skip
            _add_pair_evidence((b, d), (own, link), highest, lowest_force, seeding)
    seeding.pair_evidence[:] = -math.inf
    for k in range(gain.shape[0]):
        for link in range(k + 1):
            if seeding.pair_sum[k, link] > 0.0:
                # The sum over samples is one over the surface.
                cells = seed_samples.spread[k] * seed_samples.spread[link]
                seeding.pair_evidence[k, link] = (
                    base + gain[k, link] + math.log(seeding.pair_sum[k, link] * cells * cells)
                )
    scores, seeds = (seeding.seed_score, seeding.seed) if count == 2 else (seeding.beam_score, seeding.beam)
    found = SeedList(2, scores, seeds, seed_samples.primitive, seeding.point_normal)
    _choose_seeds(chosen.sample, base, seeding, found)


@fused_kernel
def take_samples(model: SampleModel, seeding: SeedingBuffers) -> float:
    """Fill the blocks of samples, and what the measurement tells of a further contact on each link; the log
    likelihood without one."""
    seed_samples = model.samples
    for link in range(seed_samples.spread.shape[0]):
        seeding.moment_deviation[link] = model.force_scale * seed_samples.spread[link]
    fill_sample_blocks(seed_samples, seeding)
    copy_lower(model.measurement.size, seeding.prior_covariance, seeding.factor)
    return float(fill_link_information(model.measurement, seeding))


@fused_kernel
def _add_pair_evidence(
    at: tuple[int, int], links: tuple[int, int], highest: float, lowest_force: float, seeding: SeedingBuffers
) -> None:
    """Add the likelihoods of the pairs of two blocks to those of their links, and fill `pair_likelihood`,
    `pair_reference` and `pair_bound`.

    Args:
        at, links: The blocks, and their links.
        highest: The highest gain of a pair.
        lowest_force: Both forces must exceed this along their normals [N].
        seeding: With the pairs in `pair`. The logarithm of the sum over all pairs of two links is
            `pair_gain` + log(`pair_sum`).
    """
    pairs, out = seeding.pair, seeding.pair_likelihood[at]
    reference = seeding.pair_gain[links]
    seeding.pair_bound[at] = seeding.pair_reference[at] = -math.inf
    if not highest > reference - NEGLIGIBLE:
        return
    if highest > reference:
        seeding.pair_sum[links] *= math.exp(reference - highest)
        seeding.pair_gain[links] = reference = highest
    total, pushing = 0.0, 0.0
    for i in range(PAIRS):
        exponent = max(pairs[PAIR_GAIN + i] - reference, LOWEST_EXPONENT)
        # Rounding may take a determinant below one if sensors are nearly exact.
        likelihood = exponential(exponent) / math.sqrt(max(pairs[PAIR_DET + i], 1.0))
        likelihood = likelihood if pairs[PAIR_GAIN + i] > -math.inf else 0.0
        pushes = pairs[PAIR_FORCE + i] > lowest_force
        total += likelihood
        pushing += likelihood if pushes else 0.0
        out[i] = likelihood if pushes else -likelihood
    seeding.pair_sum[links] += total
    seeding.pair_reference[at] = reference
    if pushing > 0.0:
        seeding.pair_bound[at] = reference + math.log(pushing)


@fused_kernel
def _choose_seeds(sample: np.ndarray, base: float, seeding: SeedingBuffers, found: SeedList) -> None:
    """Fill the list of seeds, or the beam: from the best blocks down until it is full, then from all.

    Args:
        sample: Indices of the samples of each block, shape (blocks, LANES).
        base: Log likelihood without contacts.
        seeding: After `_add_pair_evidence` of all blocks; `pair_bound` of those that are used up becomes
            -infinity.
        found: The list, which is filled.
    """
    bound, scores = seeding.pair_bound, found.scores
    scores[:] = -math.inf
    while scores[-1] == -math.inf:
        best, at = -math.inf, (0, 0)
        for b in range(bound.shape[0]):
            for d in range(b + 1):
                if bound[b, d] > best:
                    best, at = bound[b, d], (b, d)
        if best == -math.inf:
            return
        _add_seeds(sample, base, at, seeding, found)
    for b in range(bound.shape[0]):
        for d in range(b + 1):
            if base + bound[b, d] > scores[-1]:
                _add_seeds(sample, base, (b, d), seeding, found)


@fused_kernel
def _add_seeds(
    sample: np.ndarray, base: float, at: tuple[int, int], seeding: SeedingBuffers, found: SeedList
) -> None:
    """Add the pairs of two blocks to the list of seeds where they are good enough; arguments as above."""
    seeding.pair_bound[at] = -math.inf
    likelihood, scores = seeding.pair_likelihood[at], found.scores
    reference = base + seeding.pair_reference[at]
    limit = math.exp(scores[-1] - reference)
    for i in range(PAIRS):
        if likelihood[i] > limit:
            score = reference + math.log(likelihood[i])
            samples = sample[at[0], i // LANES], sample[at[1], i % LANES], 0
            slot = find_slot(found, score, samples)
            if slot >= 0:
                put_seed(found, score, samples, slot)
                limit = math.exp(scores[-1] - reference)
