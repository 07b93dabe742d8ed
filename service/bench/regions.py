"""Where a list of explanations says that the contact is: a mixture of Gaussians on the links' surfaces.

Every explanation is taken as a Gaussian in its tangent plane, with its probability as weight. A region of
highest density that holds 90 % of that mixture should hold the true place in 90 % of the cases. The place on
the surface has two coordinates only; the part of a covariance along the normal says how far the surface
leaves the tangent plane: by what the primitives are off, or, in a wide answer, by going around the link.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import norm, qmc

from contactsense import Contact

BESIDE = 0.01
"""A place off a tangent plane by less than this is on the same side of the link [m]; or by less than its
distance along the plane, as places up to a right angle around a round link are; or by `DEEP` standard
deviations along the normal, as places all around it are."""
DEEP = 2.0
"""See `BESIDE`."""
_LEAST = 1e-5
"""Least standard deviation, so that every density is finite [m]."""
_POINTS = 256
_NORMAL = norm.ppf(qmc.Sobol(2, scramble=True, rng=np.random.default_rng(0)).random(_POINTS))


class Mixture(NamedTuple):
    """K explanations as weighted Gaussians in their tangent planes, base frame."""

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


def mixture(contacts: Sequence[Contact]) -> Mixture:
    """The explanations of one estimate."""
    normal = np.array([c.normal_base for c in contacts]).reshape(-1, 3)
    covariance = np.array([c.covariance for c in contacts]).reshape(-1, 3, 3)
    across = np.eye(3) - normal[:, :, None] * normal[:, None, :]
    values, vectors = np.linalg.eigh(across @ covariance @ across - normal[:, :, None] * normal[:, None, :])
    # The normal's own eigenvalue is -1, the least.
    spread = np.sqrt(np.maximum(values[:, 1:], _LEAST**2))
    return Mixture(
        weight=np.array([c.probability for c in contacts]),
        link=np.array([c.link_index for c in contacts], dtype=np.int64),
        mean=np.array([c.point_base for c in contacts]).reshape(-1, 3),
        normal=normal,
        depth=np.sqrt(np.einsum("ki,kij,kj->k", normal, covariance, normal)),
        root=vectors[:, :, 1:] * spread[:, None, :],
    )


def distance(of: Mixture, link: int, points: np.ndarray) -> np.ndarray:
    """Distance of points on a link from each explanation, in its standard deviations along the surface.

    Args:
        of: K explanations.
        link: Number of the link that the points lie on.
        points: Shape (M, 3), base frame [m].

    Returns:
        Shape (K, M); infinite on another link or on the far side of it.
    """
    offset = points[None] - of.mean[:, None]
    variance = (of.root**2).sum(axis=1)
    scaled = (offset @ of.root) / variance[:, None, :]
    off = np.abs((offset * of.normal[:, None, :]).sum(axis=2))
    along = np.sqrt(np.maximum((offset**2).sum(axis=2) - off**2, 0.0))
    same = (of.link[:, None] == link) & (
        off <= np.maximum(np.maximum(BESIDE, DEEP * of.depth)[:, None], along)
    )
    return np.asarray(np.where(same, np.sqrt((scaled**2).sum(axis=2)), np.inf))


def density(of: Mixture, link: int, points: np.ndarray) -> np.ndarray:
    """Probability per area at points on a link, shape (M,) [1/m^2]; arguments as of `distance`."""
    area = 2.0 * np.pi * np.sqrt((of.root**2).sum(axis=1).prod(axis=1))
    peak = of.weight / area
    return np.asarray((peak[:, None] * np.exp(-0.5 * distance(of, link, points) ** 2)).sum(axis=0))


def samples(of: Mixture) -> np.ndarray:
    """Points spread as each explanation says, equally probable, shape (K, 256, 3) [m]."""
    return np.asarray(of.mean[:, None] + np.einsum("kij,sj->ksi", of.root, _NORMAL))


def level(of: Mixture, link: int, point: np.ndarray) -> float:
    """Probability of all places that are more probable, per area, than the given one.

    The smallest region that holds probability p holds the place if and only if its level is below p. Where
    no explanation reaches the place the level is 1, however much probability the list leaves out.
    """
    own = density(of, link, point[None])[0]
    if not own > 0.0:
        return 1.0
    spread = samples(of)
    higher = [
        (density(of, int(number), points) > own).mean()
        for number, points in zip(of.link, spread, strict=True)
    ]
    return float(of.weight @ np.array(higher))


def within(of: Mixture, link: int, center: np.ndarray, radius: float) -> float:
    """Probability that the contact is on that link and within `radius` of `center` [m]."""
    near = np.linalg.norm(samples(of) - center, axis=2) <= radius
    return float((of.weight * (of.link == link)) @ near.mean(axis=1))
