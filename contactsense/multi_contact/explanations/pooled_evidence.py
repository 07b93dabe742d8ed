"""Evidence of contacts on links that many places explain: a logarithmic opinion pool of optima and sums.

Two approximations know different things. The evidence of a joint optimum knows the measurement as it is, but
only the places near a few optima, as a normal distribution about each. A sum over the surface knows all
places, but less exactly:

- Two contacts of which nothing is known: the sum over all pairs of samples. Each is blurred by the distance
  between samples, so that pairs of links on which nothing explains the measurement keep much of it.
- A third contact beside two whose forces are free: the search for one contact sums over the surface, with the
  known contacts in a normal distribution. Their forces may pull there.

The pool is the weighted geometric mean of both,

    log p_t = w log(s_kl / n_kl) + (1 - w) log p'_t + constant,

with the share s_kl of links k, l in the sum (k = l for one contact), n_kl distinct optima on them, and the
share p'_t of optimum t in the evidence of all optima. The places become less certain as well, see
`contactsense.multi_contact.explanations.pooled_places`; those known before are in both, and stay as they are.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.multi_contact.explanations.ranked_sets import order_distinct
from contactsense.multi_contact.memory.buffers import Explanations
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.runtime.candidate_rows import MIN_REPORTED_PROBABILITY
from contactsense.solvers.posterior.mode import ENERGY_CUTOFF

SUM_WEIGHT = 0.6
"""Weight w of the sum."""
SMALLEST = 1e-12
"""Smallest share of the evidence that is told from none."""


class PooledSets(NamedTuple):
    """Explanations with the same number of contacts, whose evidence is pooled."""

    explanations: Explanations
    first: int
    """Row of the first one."""
    last: int
    """Row after the last one."""
    known: int
    """Number of known contacts, the first ones of each."""
    further: int
    """Number of further ones, 1 or 2."""


@fused_kernel
def pool_link_evidence(
    link: np.ndarray, sets: PooledSets, evidence: np.ndarray, surface_deviation: float
) -> None:
    """Pool the evidence of explanations with that of the links of their further contacts.

    Their sum remains. Duplicates, and what is negligible beside the best, lose their evidence.

    Args:
        link: Link of each primitive, shape (P,).
        sets: The explanations.
        evidence: Log evidence of each pair of links, the sum over the surface, k >= j in row k. Of one
            further contact: of each link in the diagonal, -infinity elsewhere. On return relative to the
            same as `score`, and that of links without an explanation only, -infinity for the others.
        surface_deviation: Standard deviation of the surface along its normal [m].
    """
    explanations, first, last, _, _ = sets
    order, score, pooled = explanations.order, explanations.score, explanations.probability
    highest = _highest(evidence)
    # What is negligible in the pool is farther below the best among the optima.
    cutoff = ENERGY_CUTOFF / (1.0 - SUM_WEIGHT)
    kept = order_distinct(link, explanations, first, last, 2.0 * surface_deviation, cutoff)
    if kept == 0 or highest == -math.inf:
        evidence[:] = -math.inf
        return
    best = score[order[0]]
    total, pooled_total = 0.0, 0.0
    for a in range(kept):
        t = order[a]
        k, j = links_of(link, sets, t)
        distinct = 0
        for b in range(kept):
            distinct += 1 if links_of(link, sets, order[b]) == (k, j) else 0
        share = max(math.exp(evidence[k, j] - highest), SMALLEST) / distinct
        pooled[t] = math.exp(SUM_WEIGHT * math.log(share) + (1.0 - SUM_WEIGHT) * (score[t] - best))
        total += math.exp(score[t] - best)
        pooled_total += pooled[t]
    listed = _take_listed(link, sets, highest, evidence)
    offset = best + math.log(total / max(listed, SMALLEST)) - highest
    for k in range(evidence.shape[0]):
        for j in range(k + 1):
            evidence[k, j] += offset
    for t in range(first, last):
        score[t] = -math.inf
    for a in range(kept):
        t = order[a]
        score[t] = best + math.log(total * pooled[t] / pooled_total)


@fused_kernel
def lowest_reported(evidence: np.ndarray, score: np.ndarray, stored: int) -> float:
    """Log evidence below which nothing is reported, given all evidence; arguments as for `log_of_sum`."""
    return math.log(MIN_REPORTED_PROBABILITY) + log_of_sum(evidence, score, stored)


@fused_kernel
def log_of_sum(evidence: np.ndarray, score: np.ndarray, stored: int) -> float:
    """Logarithm of the sum of all evidence: of the pairs of links, and of the first `stored` scores."""
    highest, total = _highest(evidence), 0.0
    for t in range(stored):
        highest = max(highest, score[t])
    if highest == -math.inf:
        return highest
    for t in range(stored):
        total += math.exp(score[t] - highest)
    for k in range(evidence.shape[0]):
        for j in range(k + 1):
            total += math.exp(evidence[k, j] - highest)
    return highest + math.log(total)


@fused_kernel
def _highest(evidence: np.ndarray) -> float:
    highest = -math.inf
    for k in range(evidence.shape[0]):
        for j in range(k + 1):
            highest = max(highest, evidence[k, j])
    return highest


@fused_kernel
def _take_listed(link: np.ndarray, sets: PooledSets, highest: float, evidence: np.ndarray) -> float:
    """Evidence of the links that have explanations, relative to exp(`highest`), taken out of `evidence`.
    Arguments as above."""
    listed = 0.0
    for t in range(sets.first, sets.last):
        k, j = links_of(link, sets, t)
        # Those of another explanation are zero already.
        listed += math.exp(evidence[k, j] - highest)
        evidence[k, j] = -math.inf
    return listed


@fused_kernel
def links_of(link: np.ndarray, sets: PooledSets, t: int) -> tuple[int, int]:
    """Links of the further contacts of explanation t, the farther from the base first; one link twice if
    there is one contact."""
    primitive, i = sets.explanations.primitive[t], sets.known
    a, b = link[primitive[i]], link[primitive[i + sets.further - 1]]
    return max(a, b), min(a, b)
