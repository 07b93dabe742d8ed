"""Reduction of the mixture that is reported: candidates whose places do not differ significantly are one.

A place near an edge, or on two primitives that continue each other, has a candidate on each of them, and the
distributions of both overlap. The more probable one absorbs the other: it takes the second moments of both
about its own place, as in the reduction of a mixture of normal distributions (Salmond 1990, "Mixture
reduction algorithms for target tracking in clutter"). Point, normal, force and torsion remain its own, so
that they belong together.

This is for measurements by a base sensor. Without one, places are known by centimetres, and the candidates
are maxima of the density over the surface: to reduce them would lose what the torques tell.
"""

import numpy as np

from contactsense.localization.candidates.candidate_buffers import Candidates
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.robots.vectors import Vector, subtract, vector

SIGNIFICANT_DISTANCE = 9.21
"""Two places differ significantly if their squared Mahalanobis distance is above this: a place on a surface
has two coordinates, and 99 % of a chi-squared distribution with two degrees of freedom is below."""
_MIN_VARIANCE = 1e-12
"""Added to all variances, so that exact places have a distance as well [m^2]."""
Moments = tuple[float, float, float, float, float, float]
"""Second moments xx, xy, xz, yy, yz, zz [m^2]."""


@fused_kernel
def merge_overlapping(surfaces: Surfaces, candidates: Candidates, count: int) -> int:
    """Merge candidates on one link whose places do not differ significantly.

    Args:
        surfaces: Primitives.
        candidates: `order` lists them by falling probability, before and after; `probability` and
            `covariance` of those that absorb others change.
        count: Number of candidates in `order`.

    Returns:
        Number of candidates that remain.
    """
    order, probability, first = candidates.order, candidates.probability, 0
    while first < count:
        row = order[first]
        link, point = surfaces.link[candidates.primitive[row]], vector(candidates.point[row])
        own = second_moments(candidates.covariance[row], (0.0, 0.0, 0.0))
        moments, kept = own, first + 1
        for i in range(first + 1, count):
            other = order[i]
            offset = subtract(vector(candidates.point[other]), point)
            C = candidates.covariance[other]
            if surfaces.link[candidates.primitive[other]] == link and (
                squared_distance(own, C, offset) < SIGNIFICANT_DISTANCE
            ):
                probability[row] += probability[other]
                moments = mean(moments, second_moments(C, offset), probability[other] / probability[row])
            else:
                order[kept] = other
                kept += 1
        if kept < count:
            write_moments(moments, candidates.covariance[row])
        count = kept
        first += 1
    for i in range(1, count):
        row, k = order[i], i
        while k > 0 and probability[order[k - 1]] < probability[row]:
            order[k] = order[k - 1]
            k -= 1
        order[k] = row
    return count


@fused_kernel
def second_moments(C: np.ndarray, offset: Vector) -> Moments:
    """Second moments, about a point, of a place with covariance C, shape (3, 3), that is `offset` from it."""
    x, y, z = offset
    return (
        C[0, 0] + x * x,
        C[0, 1] + x * y,
        C[0, 2] + x * z,
        C[1, 1] + y * y,
        C[1, 2] + y * z,
        C[2, 2] + z * z,
    )


@fused_kernel
def mean(a: Moments, b: Moments, share: float) -> Moments:
    """Weighted mean; `share`: weight of b."""
    rest = 1.0 - share
    return (
        rest * a[0] + share * b[0],
        rest * a[1] + share * b[1],
        rest * a[2] + share * b[2],
        rest * a[3] + share * b[3],
        rest * a[4] + share * b[4],
        rest * a[5] + share * b[5],
    )


@fused_kernel
def write_moments(moments: Moments, out: np.ndarray) -> None:
    """Write moments as a symmetric matrix, shape (3, 3)."""
    xx, xy, xz, yy, yz, zz = moments
    out[0, 0], out[0, 1], out[0, 2] = xx, xy, xz
    out[1, 0], out[1, 1], out[1, 2] = xy, yy, yz
    out[2, 0], out[2, 1], out[2, 2] = xz, yz, zz


@fused_kernel
def squared_distance(own: Moments, C: np.ndarray, offset: Vector) -> float:
    """Squared Mahalanobis distance of two places.

    Args:
        own: Covariance of the first.
        C: Covariance of the second, shape (3, 3) [m^2].
        offset: From the first to the second [m].
    """
    x, y, z = offset
    xx, xy, xz, yy, yz, zz = second_moments(C, (0.0, 0.0, 0.0))
    xx, yy, zz = own[0] + xx + _MIN_VARIANCE, own[3] + yy + _MIN_VARIANCE, own[5] + zz + _MIN_VARIANCE
    xy, xz, yz = own[1] + xy, own[2] + xz, own[4] + yz
    # d' S^-1 d by the factors L D L' of the covariance S of the difference d.
    a, b = xy / xx, xz / xx
    yy, yz, zz = yy - a * xy, yz - a * xz, zz - b * xz
    c = yz / yy
    zz -= c * yz
    y -= a * x
    z -= b * x + c * y
    return x * x / xx + y * y / yy + z * z / zz
