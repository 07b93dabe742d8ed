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
share p'_t of optimum t in the evidence of all optima. A normal distribution to the power 1 - w has a
covariance 1 / (1 - w) times as large. Places known before are in both, and stay as they are.
"""

import math

import numpy as np

from contactsense.multi_contact.buffers import Explanations
from contactsense.multi_contact.ranked_sets import order_distinct
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.solvers.posterior_mode import ENERGY_CUTOFF

SUM_WEIGHT = 0.6
"""Weight w of the sum."""
SMALLEST = 1e-12
"""Smallest share of the evidence that is told from none."""


@fused_kernel
def pool_link_evidence(
    link: np.ndarray,
    explanations: Explanations,
    first: int,
    last: int,
    i: int,
    further: int,
    evidence: np.ndarray,
    surface_deviation: float,
) -> float:
    """Pool the evidence of the explanations `first` to `last` - 1 with that of the links of their further
    contacts.

    Their sum remains. Duplicates, and what is negligible beside the best, lose their evidence.

    Args:
        link: Link of each primitive, shape (P,).
        explanations, first, last: The explanations.
        i, further: Their first further contact, and the number of further contacts, 1 or 2.
        evidence: Log evidence of each pair of links, the sum over the surface, k >= j in row k. Of one
            further contact: of each link in the diagonal, -infinity elsewhere.
        surface_deviation: Standard deviation of the surface along its normal [m].

    Returns:
        Log evidence of the links without an explanation.
    """
    order, score, pooled = explanations.order, explanations.score, explanations.probability
    highest = _highest(evidence)
    # What is negligible in the pool is farther below the best among the optima.
    cutoff = ENERGY_CUTOFF / (1.0 - SUM_WEIGHT)
    kept = order_distinct(link, explanations, first, last, 2.0 * surface_deviation, cutoff)
    if kept == 0 or highest == -math.inf:
        return -math.inf
    best = score[order[0]]
    total, pooled_total = 0.0, 0.0
    for a in range(kept):
        t = order[a]
        k, j = _links(link, explanations, t, i, further)
        distinct = 0
        for b in range(kept):
            distinct += 1 if _links(link, explanations, order[b], i, further) == (k, j) else 0
        share = max(math.exp(evidence[k, j] - highest), SMALLEST) / distinct
        pooled[t] = math.exp(SUM_WEIGHT * math.log(share) + (1.0 - SUM_WEIGHT) * (score[t] - best))
        total += math.exp(score[t] - best)
        pooled_total += pooled[t]
    listed = _listed_share(link, explanations, first, last, i, further, evidence)
    for t in range(first, last):
        score[t] = -math.inf
    for a in range(kept):
        t = order[a]
        score[t] = best + math.log(total * pooled[t] / pooled_total)
        for contact in range(i, i + further):
            _widen(explanations.covariance[t, contact], explanations.normal[t, contact], surface_deviation)
    return float(best + math.log(total * max(1.0 - listed, SMALLEST) / max(listed, SMALLEST)))


@fused_kernel
def _highest(evidence: np.ndarray) -> float:
    highest = -math.inf
    for k in range(evidence.shape[0]):
        for j in range(k + 1):
            highest = max(highest, evidence[k, j])
    return highest


@fused_kernel
def _listed_share(
    link: np.ndarray,
    explanations: Explanations,
    first: int,
    last: int,
    i: int,
    further: int,
    evidence: np.ndarray,
) -> float:
    """Share in the sum of the links that have explanations; arguments as above."""
    highest = _highest(evidence)
    total, listed = 0.0, 0.0
    for k in range(evidence.shape[0]):
        for j in range(k + 1):
            part = math.exp(evidence[k, j] - highest)
            total += part
            for t in range(first, last):
                if _links(link, explanations, t, i, further) == (k, j):
                    listed += part
                    break
    return listed / total


@fused_kernel
def _links(link: np.ndarray, explanations: Explanations, t: int, i: int, further: int) -> tuple[int, int]:
    """Links of the further contacts of explanation t, the farther from the base first."""
    a, b = link[explanations.primitive[t, i]], link[explanations.primitive[t, i + further - 1]]
    return max(a, b), min(a, b)


@fused_kernel
def _widen(covariance: np.ndarray, normal: np.ndarray, surface_deviation: float) -> None:
    """Covariance [m^2] of a place whose normal distribution along the surface is taken to the power 1 - w.

    What a covariance that was adopted from elsewhere has along the normal is dropped.
    """
    C, n = covariance, normal
    x, y, z = (
        C[0, 0] * n[0] + C[0, 1] * n[1] + C[0, 2] * n[2],
        C[1, 0] * n[0] + C[1, 1] * n[1] + C[1, 2] * n[2],
        C[2, 0] * n[0] + C[2, 1] * n[1] + C[2, 2] * n[2],
    )
    along = (x, y, z)
    twice = n[0] * x + n[1] * y + n[2] * z
    for k in range(3):
        for j in range(3):
            tangential = C[k, j] - n[k] * along[j] - along[k] * n[j] + twice * n[k] * n[j]
            C[k, j] = surface_deviation * surface_deviation * n[k] * n[j] + tangential / (1.0 - SUM_WEIGHT)
