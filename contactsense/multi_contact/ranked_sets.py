"""Stores explanations, sets of simultaneous contacts, and ranks them by their evidence."""

import math

import numpy as np

from contactsense.kinematics.linalg.cholesky import invert_factored
from contactsense.localization.candidate_buffers import Candidates
from contactsense.multi_contact.buffers import UNKNOWNS, Explanations, OptimizerState
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.solvers.posterior_mode import ENERGY_CUTOFF

LARGEST_UNLISTED = 20.0
"""Upper bound of the log odds of what is not among the explanations."""


@fused_kernel
def store_explanation(
    optimizer: OptimizerState,
    surface_deviation: float,
    count: int,
    energy: float,
    score: float,
    explanations: Explanations,
    t: int,
) -> None:
    """Write the contacts in `optimizer` as explanation t."""
    explanations.contacts[t] = count
    explanations.energy[t] = energy
    explanations.log_evidence[t] = score
    explanations.score[t] = score
    invert_factored(optimizer, count * UNKNOWNS)
    for k in range(6):
        explanations.wrench[t, k] = 0.0
    for i in range(count):
        explanations.primitive[t, i] = optimizer.primitive[i]
        explanations.torsion[t, i] = optimizer.torsion[i]
        for k in range(3):
            explanations.point[t, i, k] = optimizer.point[i, k]
            explanations.normal[t, i, k] = optimizer.frame[i, k, 0]
            explanations.force[t, i, k] = optimizer.force[i, k]
        for k in range(6):
            explanations.wrench[t, k] += optimizer.wrench[i, k]
        _contact_covariance(
            optimizer,
            i,
            surface_deviation,
            explanations.covariance[t, i],
            explanations.force_covariance[t, i],
        )
    _wrench_covariance(optimizer, count * UNKNOWNS, explanations.wrench_covariance[t])


@fused_kernel
def _contact_covariance(
    optimizer: OptimizerState,
    i: int,
    surface_deviation: float,
    point_covariance: np.ndarray,
    force_covariance: np.ndarray,
) -> None:
    """Covariance of point [m^2] and force [N^2] of contact i."""
    at = i * UNKNOWNS
    V, G, T = optimizer.inverse, optimizer.wrench_jacobian, optimizer.saved_frame[i]
    for k in range(3):
        for a in range(3):
            point_covariance[k, a] = surface_deviation * surface_deviation * T[k, 0] * T[a, 0]
            for b in range(2):
                for d in range(2):
                    point_covariance[k, a] += T[k, 1 + b] * V[at + 4 + b, at + 4 + d] * T[a, 1 + d]
            force_covariance[k, a] = 0.0
            for b in range(3):
                for d in range(3):
                    force_covariance[k, a] += G[k, at + b] * V[at + b, at + d] * G[a, at + d]


@fused_kernel
def _wrench_covariance(optimizer: OptimizerState, size: int, out: np.ndarray) -> None:
    """Covariance of the sum of all wrenches."""
    V, G = optimizer.inverse, optimizer.wrench_jacobian
    for a in range(6):
        for b in range(a + 1):
            x = 0.0
            for i in range(size):
                for k in range(size):
                    x += G[a, i] * V[i, k] * G[b, k]
            out[a, b] = x
            out[b, a] = x


@fused_kernel
def adopt_candidate(candidates: Candidates, row: int, i: int, explanations: Explanations, t: int) -> None:
    """Give contact i of explanation t the covariance of the candidate at which its optimization started, and
    the explanation its probability."""
    explanations.probability[t] = candidates.probability[row]
    for k in range(3):
        for a in range(3):
            explanations.covariance[t, i, k, a] = candidates.covariance[row, k, a]


@fused_kernel
def share_evidence(explanations: Explanations, first: int, last: int) -> None:
    """Share the evidence of the explanations `first` to `last` - 1 in proportion to their probabilities.

    These are integrals over the surface; the evidence of each optimum is that of a normal distribution.
    """
    best, probability = -math.inf, 0.0
    for t in range(first, last):
        best = max(best, explanations.score[t])
        probability += explanations.probability[t]
    total = 0.0
    for t in range(first, last):
        total += math.exp(explanations.score[t] - best)
    for t in range(first, last):
        explanations.score[t] = best + math.log(total * explanations.probability[t] / probability)


@fused_kernel
def rank_sets(
    link: np.ndarray, explanations: Explanations, stored: int, unlisted: float, min_separation: float
) -> int:
    """Sort the explanations, drop duplicates and improbable ones, normalize; returns how many remain.

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
    return kept


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
        if not _is_duplicate_set(link, explanations, t, kept, min_separation):
            order[kept] = t
            kept += 1
    return kept


@fused_kernel
def _is_duplicate_set(
    link: np.ndarray, explanations: Explanations, t: int, count_kept: int, min_separation: float
) -> bool:
    """Whether one of the first `count_kept` explanations has the same contacts.

    In any order, within `min_separation` [m].
    """
    for i in range(count_kept):
        u = explanations.order[i]
        if explanations.contacts[u] != explanations.contacts[t]:
            continue
        near = 0
        for a in range(explanations.contacts[t]):
            for b in range(explanations.contacts[t]):
                dx = explanations.point[u, b, 0] - explanations.point[t, a, 0]
                dy = explanations.point[u, b, 1] - explanations.point[t, a, 1]
                dz = explanations.point[u, b, 2] - explanations.point[t, a, 2]
                if (
                    link[explanations.primitive[u, b]] == link[explanations.primitive[t, a]]
                    and dx * dx + dy * dy + dz * dz < min_separation * min_separation
                ):
                    near += 1
                    break
        if near == explanations.contacts[t]:
            return True
    return False
