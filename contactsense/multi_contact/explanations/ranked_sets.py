"""Ranks explanations, sets of simultaneous contacts, by their evidence; duplicates are dropped."""

import math

import numpy as np

from contactsense.multi_contact.memory.buffers import Explanations
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.runtime.candidate_rows import MIN_REPORTED_PROBABILITY
from contactsense.solvers.posterior.mode import ENERGY_CUTOFF

LARGEST_UNLISTED = 20.0
"""Upper bound of the log odds of what is not among the explanations."""
MIN_SEPARATION_STD = 0.3
"""Distance below which two places are one, in standard deviations of the more certain one.

Optima on neighbouring primitives are often a millimetre apart where places are uncertain by centimetres.
"""


@fused_kernel
def share_evidence(
    link: np.ndarray, explanations: Explanations, first: int, last: int, min_separation: float
) -> None:
    """Share the evidence of the explanations `first` to `last` - 1 in proportion to their probabilities.

    These are integrals over parts of the surface; the evidence of each optimum is that of a normal
    distribution. Where several optimizations have ended at one optimum, it has the probabilities of all, and
    its evidence counts once. Other arguments as for `rank_sets`.
    """
    score, probability = explanations.score, explanations.probability
    kept = order_distinct(link, explanations, first, last, min_separation, math.inf)
    if kept == 0:
        return
    best, total, whole = score[explanations.order[0]], 0.0, 0.0
    for a in range(kept):
        total += math.exp(score[explanations.order[a]] - best)
    for t in range(first, last):
        whole += probability[t]
        a = _duplicate_of(link, explanations, t, kept, min_separation)
        if a >= 0 and explanations.order[a] != t:
            probability[explanations.order[a]] += probability[t]
    for t in range(first, last):
        score[t] = -math.inf
    for a in range(kept):
        t = explanations.order[a]
        score[t] = best + math.log(total * probability[t] / whole)


@fused_kernel
def rank_sets(
    link: np.ndarray, explanations: Explanations, stored: int, unlisted: float, min_separation: float
) -> int:
    """Sort the explanations, drop duplicates and improbable ones, normalize; returns how many remain.

    They are in order of falling probability, but for the first one, which has an optimum.

    `unlisted`: log evidence of what is not among them.
    """
    order = explanations.order
    kept = order_distinct(link, explanations, 0, stored, min_separation, ENERGY_CUTOFF)
    if kept == 0:
        return 0
    best = explanations.score[order[0]]
    total = math.exp(min(unlisted - best, LARGEST_UNLISTED))
    for i in range(kept):
        explanations.probability[order[i]] = math.exp(explanations.score[order[i]] - best)
        total += explanations.probability[order[i]]
    for i in range(kept):
        explanations.probability[order[i]] /= total
    _put_optimum_first(explanations, kept)
    return kept


@fused_kernel
def _put_optimum_first(explanations: Explanations, kept: int) -> None:
    """Put the most probable one with an optimum before those without, if it is reported.

    Of the places of the latter, fewer are right, even where that pair of links is more probable.
    """
    order, first = explanations.order, 0
    while first < kept and explanations.log_evidence[order[first]] == -math.inf:
        first += 1
    if first < kept and explanations.probability[order[first]] >= MIN_REPORTED_PROBABILITY:
        t = order[first]
        for i in range(first, 0, -1):
            order[i] = order[i - 1]
        order[0] = t


@fused_kernel
def order_distinct(
    link: np.ndarray, explanations: Explanations, first: int, last: int, min_separation: float, cutoff: float
) -> int:
    """Fill `explanations.order` with the rows `first` to `last` - 1 by falling score.

    Without duplicates, and without those whose log evidence is worse than the best by more than `cutoff`.

    Returns:
        Number of rows.
    """
    order = explanations.order
    count = last - first
    for i in range(count):
        order[i] = first + i
    kept = 0
    best = 0.0
    for i in range(count):
        for k in range(i + 1, count):
            if explanations.score[order[k]] > explanations.score[order[i]]:
                order[i], order[k] = order[k], order[i]
        t = order[i]
        if i == 0:
            best = explanations.score[t]
        if not explanations.score[t] >= best - cutoff:
            break
        if _duplicate_of(link, explanations, t, kept, min_separation) < 0:
            order[kept] = t
            kept += 1
    return kept


@fused_kernel
def _duplicate_of(
    link: np.ndarray, explanations: Explanations, t: int, count_kept: int, min_separation: float
) -> int:
    """Index of the first of `count_kept` explanations in `order` that has the same contacts as t, in any
    order; -1 if none has."""
    for i in range(count_kept):
        u = explanations.order[i]
        if explanations.contacts[u] == explanations.contacts[t] and _match_one_to_one(
            link, explanations, u, t, min_separation
        ):
            return i
    return -1


@fused_kernel
def _match_one_to_one(
    link: np.ndarray, explanations: Explanations, u: int, t: int, min_separation: float
) -> bool:
    """Whether each contact of explanation `t` has one of its own in `u`, on its link and near it.

    By Hall's marriage theorem this is so if any n contacts of `t` have at least n near ones in `u`.
    """
    contacts = explanations.contacts[t]
    for subset in range(1, 1 << contacts):
        chosen = near = 0
        for a in range(contacts):
            chosen += subset >> a & 1
        for b in range(contacts):
            for a in range(contacts):
                if (
                    subset >> a & 1
                    and link[explanations.primitive[u, b]] == link[explanations.primitive[t, a]]
                    and _are_close(explanations, (u, b), (t, a), min_separation)
                ):
                    near += 1
                    break
        if near < chosen:
            return False
    return True


@fused_kernel
def _are_close(
    explanations: Explanations, first: tuple[int, int], second: tuple[int, int], min_separation: float
) -> bool:
    """Whether two contacts, each given by explanation and index in it, are at one place.

    Within `min_separation` [m] or `MIN_SEPARATION_STD` of their standard deviations.
    """
    c, d = explanations.point[first], explanations.point[second]
    C, D = explanations.covariance[first], explanations.covariance[second]
    variance = min(C[0, 0] + C[1, 1] + C[2, 2], D[0, 0] + D[1, 1] + D[2, 2])
    distance2 = (c[0] - d[0]) ** 2 + (c[1] - d[1]) ** 2 + (c[2] - d[2]) ** 2
    return bool(distance2 < max(min_separation**2, MIN_SEPARATION_STD**2 * variance))
