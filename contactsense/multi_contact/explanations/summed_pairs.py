"""Pairs of links on which the joint search has no optimum, as explanations: what the sum over all pairs of
samples tells of their contacts.

The sum tells how probable such a pair of links is, and where on it, but each place only by the distance
between samples. So the contacts are at the likeliest pair of samples that push, with the forces that are most
likely there; the covariances of the places are the mean squared deviations of all pairs of samples from it.
"""

import math

import numpy as np

from contactsense.multi_contact.explanations.pooled_evidence import lowest_reported
from contactsense.multi_contact.likelihood.pair_places import (
    fill_place_covariance,
    fill_place_likelihood,
    find_likeliest_pair,
    sample_at,
)
from contactsense.multi_contact.likelihood.pair_wrench import fill_pair_wrench
from contactsense.multi_contact.likelihood.sample_likelihood import SampleModel
from contactsense.multi_contact.memory.buffers import MAX_SUMMED_PAIRS, Explanations, SeedingBuffers
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.vectors import dot, vector


@fused_kernel
def store_summed_pairs(
    model: SampleModel,
    surface_deviation: float,
    seeding: SeedingBuffers,
    explanations: Explanations,
    stored: int,
) -> int:
    """Store the most probable pairs of links without an optimum as explanations.

    Args:
        model, seeding: As for `contactsense.multi_contact.seeding.seed_search.find_seeds`, without known
            contacts, after `contactsense.multi_contact.explanations.pooled_evidence.pool_link_evidence`. Of
            those that are stored, `seeding.pair_evidence` becomes -infinity.
        surface_deviation: Standard deviation of the surface along its normal [m].
        explanations, stored: The explanations, and how many there are.

    Returns:
        How many there are now.
    """
    seed_samples = model.samples
    evidence, score = seeding.pair_evidence, explanations.score
    lowest, highest = lowest_reported(evidence, score, stored), math.inf
    for _ in range(MAX_SUMMED_PAIRS):
        own, link, highest = _most_probable(evidence, highest)
        if not highest > lowest:
            break
        one, other = find_likeliest_pair(seed_samples, own, link, seeding)
        if one < 0:
            continue
        t, samples = stored, (sample_at(seed_samples, one), sample_at(seed_samples, other))
        explanations.contacts[t], explanations.score[t] = 2, highest
        explanations.log_evidence[t] = -math.inf
        fill_pair_wrench(model, samples, seeding, explanations, t)
        all_push = True
        for i in range(2):
            explanations.primitive[t, i] = seed_samples.primitive[samples[i]]
            explanations.torsion[t, i] = 0.0
            for k in range(3):
                explanations.point[t, i, k] = seeding.point_normal[samples[i], k]
                explanations.normal[t, i, k] = seeding.point_normal[samples[i], 3 + k]
            push = -dot(vector(explanations.force[t, i]), vector(explanations.normal[t, i]))
            all_push = all_push and push > 0.0
        # Rounding may turn a force if sensors are nearly exact.
        if not all_push:
            continue
        fill_place_likelihood(seed_samples, own, link, (one, other), seeding)
        for i in range(2):
            fill_place_covariance(
                seed_samples,
                own if i == 0 else link,
                i,
                explanations.point[t, i],
                surface_deviation,
                seeding,
                explanations.covariance[t, i],
            )
        evidence[own, link] = -math.inf
        stored += 1
    return stored


@fused_kernel
def _most_probable(evidence: np.ndarray, below: float) -> tuple[int, int, float]:
    """The pair of links with the highest evidence that is lower than `below`, and that evidence."""
    own, link, highest = 0, 0, -math.inf
    for k in range(evidence.shape[0]):
        for j in range(k + 1):
            if highest < evidence[k, j] < below:
                own, link, highest = k, j, evidence[k, j]
    return own, link, highest
