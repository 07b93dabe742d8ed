"""Importance weights of the candidates of a further contact: the forces of known contacts push.

The search for one contact takes the free forces of known contacts for normally distributed: they may pull,
or lie far outside the friction cone. A candidate that needs such forces is less probable than that search
states. Given a candidate, the known forces are normally distributed, too. With the prior of pushing forces,
p, in place of the normal one, q, the evidence of the candidate is multiplied by

    w = E[p(f) / q(f) | candidate]

(importance sampling, e.g. A. B. Owen, "Monte Carlo theory, methods and examples", 2013, chapter 9). Pushing
forces have the size that q gives them, and a friction ratio with the density of Student's t distribution with
nu degrees of freedom. With f in units of q, x_0 along the outward normal and x_t across, where the deviations
of q are RATIO_FACTOR times those of the friction ratio, p / q is

    (1 + (RATIO_FACTOR |x_t| / x_0)^2 / nu)^(-(nu + 2) / 2)    if x_0 < 0, else 0,

up to a factor that is the same for all candidates. It is at most one, so that few points suffice for the
mean.
"""

import math

import numpy as np
from scipy.special import ndtri

from contactsense.kinematics.linalg.cholesky import cholesky, substitute_lower
from contactsense.localization.candidates.candidate_buffers import Candidates
from contactsense.multi_contact.likelihood.link_information import log_likelihood
from contactsense.multi_contact.likelihood.sample_likelihood import (
    RATIO_FACTOR,
    SampleModel,
    add_contact_covariance,
    copy_lower,
    force_deviations,
)
from contactsense.multi_contact.memory.buffers import MAX_CONTACTS, SeedingBuffers
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.vectors import norm, vector
from contactsense.solvers.posterior.contact_prior import STUDENT_DOF

MIN_WEIGHT = 1e-6
"""Lower bound of a weight: the distribution of the forces is not exactly normal."""
POINTS = 128, 512
"""Points of the mean over the forces of one known contact, and of two."""
_IRRATIONAL = np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0, 13.0])[: 3 * (MAX_CONTACTS - 1)]
NORMAL_POINTS = ndtri(np.outer(np.arange(POINTS[-1]) + 0.5, _IRRATIONAL) % 1.0)
"""Points of a standard normal distribution, shape (512, 6): Richtmyer's quasi-Monte Carlo rule ("The
evaluation of definite integrals, and a quasi-Monte-Carlo method based on the properties of algebraic
numbers", 1951)."""
_ROUNDING = 1e-6
"""Added to the variances, in units of the prior: more than rounding may take from them."""


@fused_kernel
def weigh_by_known_forces(
    links: np.ndarray,
    model: SampleModel,
    known_count: int,
    candidates: Candidates,
    found: int,
    seeding: SeedingBuffers,
) -> None:
    """Weigh candidates, and sort them by falling probability; the probabilities add up to one.

    Args:
        links: Link of each primitive, shape (P,).
        model: The measurement.
        known_count: Number of known contacts, whose forces are free.
        candidates: Ranked candidates; `order` and `probability` are changed.
        found: Their number.
        seeding: After `initialize_seeding`.
    """
    total = 0.0
    for k in range(found):
        row = candidates.order[k]
        candidates.probability[row] *= candidate_weight(links, model, known_count, candidates, row, seeding)
        total += candidates.probability[row]
    for k in range(found):
        row, place = candidates.order[k], k
        candidates.probability[row] /= total
        while place > 0 and candidates.probability[candidates.order[place - 1]] < candidates.probability[row]:
            candidates.order[place] = candidates.order[place - 1]
            place -= 1
        candidates.order[place] = row


@fused_kernel
def candidate_weight(
    links: np.ndarray,
    model: SampleModel,
    known_count: int,
    candidates: Candidates,
    row: int,
    seeding: SeedingBuffers,
) -> float:
    """Importance weight of one candidate, from `MIN_WEIGHT` to 1.

    Args:
        links, model, known_count, candidates, seeding: As for `weigh_by_known_forces`.
        row: The candidate's row.
    """
    m = model.measurement[1]
    c, n, C = candidates.point[row], candidates.normal[row], candidates.covariance[row]
    force_norm = max(model.force_scale, norm(vector(candidates.force[row])))
    copy_lower(m, seeding.prior_covariance, seeding.factor)
    add_contact_covariance(
        model.measurement,
        links[candidates.primitive[row]],
        (c[0], c[1], c[2], n[0], n[1], n[2]),
        force_deviations(force_norm, model.friction_ratio),
        force_norm * math.sqrt(0.5 * (C[0, 0] + C[1, 1] + C[2, 2])),
        seeding.force_jacobian,
        seeding.weighted_innovation,
        seeding.factor,
    )
    log_likelihood(m, seeding)
    fill_known_forces(m, 3 * known_count, seeding)
    return max(_mean_ratio(known_count, seeding), MIN_WEIGHT)


@fused_kernel
def fill_known_forces(m: int, size: int, seeding: SeedingBuffers) -> None:
    """Mean and covariance of the known forces given the rows, in units of their prior.

    Args:
        m: Number of rows.
        size: Number of components of the known forces, three of each.
        seeding: After `contactsense.multi_contact.likelihood.link_information.log_likelihood`. Filled: the
            mean `known_force`, and `known_force_factor`, the Cholesky factor of the covariance.
    """
    L, z, U = seeding.factor, seeding.weighted_innovation, seeding.known_root
    mean, V = seeding.known_force, seeding.known_force_factor
    for r in range(m):
        for a in range(size):
            U[r, a] = seeding.known_jacobian[r, a]
    substitute_lower(L, m, U, size)
    for a in range(size):
        mean[a] = 0.0
        for r in range(m):
            mean[a] += U[r, a] * z[r]
        for b in range(a + 1):
            V[a, b] = 1.0 + _ROUNDING if a == b else 0.0
            for r in range(m):
                V[a, b] -= U[r, a] * U[r, b]
    cholesky(V, size)


@fused_kernel
def _mean_ratio(known_count: int, seeding: SeedingBuffers) -> float:
    """Mean of the ratio of the priors over the distribution of the known forces."""
    mean, V, force = seeding.known_force, seeding.known_force_factor, seeding.known_force_point
    total, points = 0.0, POINTS[known_count - 1]
    for k in range(points):
        ratio = 1.0
        for a in range(3 * known_count):
            force[a] = mean[a]
            for b in range(a + 1):
                force[a] += V[a, b] * NORMAL_POINTS[k, b]
        for i in range(known_count):
            ratio *= prior_ratio(force[3 * i], force[3 * i + 1], force[3 * i + 2])
        total += ratio
    return total / points


@fused_kernel
def prior_ratio(normal: float, first: float, second: float) -> float:
    """Ratio p / q of the densities of a force, up to a factor; 0 for a pull, at most 1.

    Args:
        normal: Component along the outward normal, in units of q's standard deviation.
        first, second: Along two tangents, likewise.
    """
    if normal >= 0.0:
        return 0.0
    ratio2 = RATIO_FACTOR * RATIO_FACTOR * (first * first + second * second) / (normal * normal)
    return float((1.0 + ratio2 / STUDENT_DOF) ** (-0.5 * (STUDENT_DOF + 2.0)))
