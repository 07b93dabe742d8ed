"""Posterior of the contact point as a mixture of Gaussians on the links' surfaces.

Every candidate is a Gaussian in its tangent plane, weighted by its probability. The region of highest density
with 90 % of the mixture's probability should contain the true point in 90 % of the cases. The point on the
surface has two coordinates only; the covariance along the normal describes how far the surface departs from
the tangent plane: by the error of the primitives, or by curvature for a wide distribution.
"""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from scipy.stats import chi2, norm, qmc

MAX_NORMAL_DISTANCE = 0.01
"""A point this close to a tangent plane is on the same side of the link [m]; so is one closer to the plane
than its distance along the plane (up to a right angle around a round link), or within `MAX_NORMAL_STD`
standard deviations along the normal."""
MAX_NORMAL_STD = 2.0
"""See `MAX_NORMAL_DISTANCE`."""
EDGE = float(np.sqrt(chi2.isf(1e-3, 2)))
"""Number of standard deviations along the surface to the edge of a candidate's ellipse of 99.9 % ..."""
_NORMAL_EDGE = float(np.sqrt(chi2.isf(1e-3, 1)))
"""... and along its normal: the far side of the link, for a candidate that goes around it."""
_MIN_STD = 1e-5
"""Smallest standard deviation, so that every density is finite [m]."""
_POINTS = 256
_NORMAL = norm.ppf(qmc.Sobol(2, scramble=True, rng=np.random.default_rng(0)).random(_POINTS))


class Candidate(Protocol):
    """What the mixture takes from a `contactsense.Contact`."""

    @property
    def link_index(self) -> int: ...
    @property
    def probability(self) -> float: ...
    @property
    def point_base(self) -> np.ndarray: ...
    @property
    def normal_base(self) -> np.ndarray: ...
    @property
    def covariance(self) -> np.ndarray: ...


class Mixture(NamedTuple):
    """K candidates as weighted Gaussians in their tangent planes, base frame."""

    weight: np.ndarray
    """Probability of each, shape (K,)."""
    link: np.ndarray
    """Number of its link, shape (K,)."""
    mean: np.ndarray
    """Its place, shape (K, 3) [m]."""
    normal: np.ndarray
    """Outward normal, shape (K, 3)."""
    depth: np.ndarray
    """Its standard deviation along the normal, shape (K,) [m]."""
    root: np.ndarray
    """Columns: main tangent directions times their standard deviations, shape (K, 3, 2) [m]."""


def mixture(contacts: Sequence[Candidate]) -> Mixture:
    """The explanations of one estimate."""
    normal = np.array([c.normal_base for c in contacts]).reshape(-1, 3)
    covariance = np.array([c.covariance for c in contacts]).reshape(-1, 3, 3)
    across = np.eye(3) - normal[:, :, None] * normal[:, None, :]
    values, vectors = np.linalg.eigh(across @ covariance @ across - normal[:, :, None] * normal[:, None, :])
    # The normal's eigenvalue is -1, the smallest.
    std = np.sqrt(np.maximum(values[:, 1:], _MIN_STD**2))
    return Mixture(
        weight=np.array([c.probability for c in contacts]),
        link=np.array([c.link_index for c in contacts], dtype=np.int64),
        mean=np.array([c.point_base for c in contacts]).reshape(-1, 3),
        normal=normal,
        depth=np.sqrt(np.einsum("ki,kij,kj->k", normal, covariance, normal)),
        root=vectors[:, :, 1:] * std[:, None, :],
    )


def distance(
    of: Mixture, link: int | np.ndarray, points: np.ndarray, max_normal_std: float = MAX_NORMAL_STD
) -> np.ndarray:
    """Distance of points on links from each candidate, in its standard deviations along the surface.

    Args:
        of: K candidates.
        link: Index of the link of the points: one for all, or shape (M,).
        points: Shape (M, 3), base frame [m].
        max_normal_std: In place of `MAX_NORMAL_STD`.

    Returns:
        Shape (K, M); infinite on another link or on the far side of it.
    """
    offset = points[None] - of.mean[:, None]
    variance = (of.root**2).sum(axis=1)
    # Along the normal, along the main tangent directions in their standard deviations.
    height = np.abs((offset @ of.normal[:, :, None])[:, :, 0])
    scaled = offset @ (of.root / variance[:, None, :])
    along = scaled**2 @ variance[:, :, None]
    radius = np.sqrt(along[:, :, 0])
    same_side = (of.link[:, None] == link) & (
        height <= np.maximum(np.maximum(MAX_NORMAL_DISTANCE, max_normal_std * of.depth)[:, None], radius)
    )
    return np.asarray(np.where(same_side, np.sqrt(scaled[:, :, 0] ** 2 + scaled[:, :, 1] ** 2), np.inf))


def explains(of: Mixture, link: int, points: np.ndarray) -> np.ndarray:
    """Whether points on a link, shape (M, 3) [m], are in the ellipse of 99.9 % of each candidate, along its
    surface and along its normal; shape (K, M)."""
    return distance(of, link, points, _NORMAL_EDGE) <= EDGE


def density(of: Mixture, far: np.ndarray) -> np.ndarray:
    """Probability per area at points with the `distance` `far` from the candidates, shape (K, M); shape (M,)
    [1/m^2]."""
    area = 2.0 * np.pi * np.sqrt((of.root**2).sum(axis=1).prod(axis=1))
    return np.asarray((of.weight / area) @ np.exp(-0.5 * far**2))


def samples(of: Mixture) -> np.ndarray:
    """Equally probable points of each candidate's distribution, shape (K, 256, 3) [m]."""
    return np.asarray(of.mean[:, None] + _NORMAL @ of.root.transpose(0, 2, 1))


def sample_distance(of: Mixture) -> np.ndarray:
    """`distance` of all `samples`, those of the first candidate first, shape (K, K * 256)."""
    return distance(of, np.repeat(of.link, _POINTS), samples(of).reshape(-1, 3))


def level(of: Mixture, link: int, point: np.ndarray, drawn: np.ndarray | None = None) -> float:
    """Probability of all points with a higher density than the given one.

    The smallest region with probability p contains the point if and only if its level is below p. Where no
    candidate reaches the point the level is 1, whatever probability is not listed.

    `drawn`: the `sample_distance`, if known.
    """
    own = density(of, distance(of, link, point[None]))[0]
    if not own > 0.0:
        return 1.0
    drawn = sample_distance(of) if drawn is None else drawn
    higher = (density(of, drawn) > own).reshape(len(of.weight), _POINTS)
    return float(of.weight @ higher.mean(axis=1))


def within(of: Mixture, link: int, center: np.ndarray, radius: float) -> float:
    """Probability that the contact is on that link and within `radius` of `center` [m]."""
    near = np.linalg.norm(samples(of) - center, axis=2) <= radius
    return float((of.weight * (of.link == link)) @ near.mean(axis=1))
