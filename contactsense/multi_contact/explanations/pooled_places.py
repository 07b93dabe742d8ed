"""Covariances of the places of explanations whose evidence is pooled with a sum over the surface
(`contactsense.multi_contact.explanations.pooled_evidence`).

A normal distribution to the power 1 - w has a covariance 1 / (1 - w) times as large. The sum over all pairs
of samples on two links also tells how far the places are from those of an optimum. Taken for a normal
distribution as well, its pool with the optimum has the covariance

    ((1 - w) C^-1 + w S^-1)^-1 = C ((1 - w) S + w C)^-1 S,

C of the optimum and S of the sum, both along the surface. That widens a precise optimum, but hardly one that
knows no more than the sum.
"""

import numpy as np

from contactsense.multi_contact.explanations.pooled_evidence import (
    SUM_WEIGHT,
    PooledSets,
    links_of,
    lowest_reported,
)
from contactsense.multi_contact.likelihood.pair_places import fill_place_covariance, fill_place_likelihood
from contactsense.multi_contact.memory.buffers import Explanations, SeedingBuffers
from contactsense.multi_contact.memory.seed_samples import SeedSamples
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.vectors import Vector, tangents, vector

PLACE_WEIGHT = 0.7
"""Weight w of the sum over all pairs of samples."""
Symmetric = tuple[float, float, float]
"""A symmetric 2x2 matrix: 00, 01, 11."""


@fused_kernel
def widen_places(sets: PooledSets, surface_deviation: float) -> None:
    """Widen the places of the further contacts of explanations.

    Arguments as for `contactsense.multi_contact.explanations.pooled_evidence.pool_link_evidence`.
    """
    for t in range(sets.first, sets.last):
        for i in range(sets.known, sets.known + sets.further):
            _widen(sets.explanations, t, i, surface_deviation)


@fused_kernel
def pool_places(
    link: np.ndarray,
    seed_samples: SeedSamples,
    surface_deviation: float,
    seeding: SeedingBuffers,
    sets: PooledSets,
) -> None:
    """Pool the places of explanations, two contacts with nothing known before, with the sum over all pairs of
    samples.

    Of two contacts on one link the sum does not tell which is which; they are widened only.

    Args:
        link, sets, surface_deviation: As for
            `contactsense.multi_contact.explanations.pooled_evidence.pool_link_evidence`, after it.
        seed_samples, seeding: The samples, after
            `contactsense.multi_contact.seeding.pair_seeding.seed_pairs`.
    """
    explanations, first, last, _, _ = sets
    lowest = lowest_reported(seeding.pair_evidence, explanations.score, last)
    for own in range(seeding.pair_evidence.shape[0]):
        for other in range(own + 1):
            is_filled = False
            for t in range(first, last):
                if not (explanations.score[t] > lowest and links_of(link, sets, t) == (own, other)):
                    continue
                if own == other:
                    _widen(explanations, t, 0, surface_deviation)
                    _widen(explanations, t, 1, surface_deviation)
                    continue
                if not is_filled:
                    fill_place_likelihood(seed_samples, own, other, (0, 0), seeding)
                    is_filled = True
                for i in range(2):
                    at = link[explanations.primitive[t, i]]
                    fill_place_covariance(
                        seed_samples, at, 0 if at == own else 1, explanations.point[t, i], surface_deviation,
                        seeding, seeding.place_covariance,
                    )  # fmt: skip
                    pool_covariance(
                        explanations.covariance[t, i], seeding.place_covariance, explanations.normal[t, i],
                        surface_deviation,
                    )  # fmt: skip


@fused_kernel
def pool_covariance(
    covariance: np.ndarray, of_sum: np.ndarray, normal: np.ndarray, surface_deviation: float
) -> None:
    """Pool the covariance of an optimum's place with that of the sum.

    Args:
        covariance: That of the optimum, shape (3, 3) [m^2]; filled.
        of_sum: That of the sum about the same place, shape (3, 3) [m^2].
        normal: Outward unit normal at the optimum, shape (3,).
        surface_deviation: Standard deviation of the surface along it [m].
    """
    n, w = vector(normal), PLACE_WEIGHT
    C, S = _along(covariance, n), _along(of_sum, n)
    x, y, z = (1.0 - w) * S[0] + w * C[0], (1.0 - w) * S[1] + w * C[1], (1.0 - w) * S[2] + w * C[2]
    det = x * z - y * y
    # C times the inverse, then times S.
    a, b = (C[0] * z - C[1] * y) / det, (C[1] * x - C[0] * y) / det
    c, d = (C[1] * z - C[2] * y) / det, (C[2] * x - C[1] * y) / det
    pooled = (a * S[0] + b * S[1], a * S[1] + b * S[2], c * S[1] + d * S[2])
    _set_along(covariance, n, pooled, surface_deviation)


@fused_kernel
def _widen(explanations: Explanations, t: int, i: int, surface_deviation: float) -> None:
    """Take the normal distribution of a place to the power 1 - w."""
    n = vector(explanations.normal[t, i])
    x, y, z = _along(explanations.covariance[t, i], n)
    by = 1.0 / (1.0 - SUM_WEIGHT)
    _set_along(explanations.covariance[t, i], n, (by * x, by * y, by * z), surface_deviation)


@fused_kernel
def _along(C: np.ndarray, n: Vector) -> Symmetric:
    """Covariance along the tangents; what it has along the normal is dropped."""
    s, t = tangents(n)
    return bilinear_form(C, s, s), bilinear_form(C, s, t), bilinear_form(C, t, t)


@fused_kernel
def bilinear_form(C: np.ndarray, a: Vector, b: Vector) -> float:
    """a . C b, for a matrix of shape (3, 3)."""
    total = 0.0
    for k in range(3):
        total += a[k] * (C[k, 0] * b[0] + C[k, 1] * b[1] + C[k, 2] * b[2])
    return total


@fused_kernel
def _set_along(C: np.ndarray, n: Vector, along: Symmetric, surface_deviation: float) -> None:
    """Fill a covariance from that along the tangents, and the standard deviation along the normal."""
    s, t = tangents(n)
    for k in range(3):
        for j in range(3):
            C[k, j] = (
                surface_deviation * surface_deviation * n[k] * n[j]
                + along[0] * s[k] * s[j]
                + along[1] * (s[k] * t[j] + t[k] * s[j])
                + along[2] * t[k] * t[j]
            )
