"""How much of the neighbourhood of a place can be touched while a contact lasts: the rule of
`contactsense.localization.accessibility` for a place estimated from all samples of a contact."""

import math
from typing import NamedTuple

import numpy as np

from contactsense.localization.accessibility import (
    accessible_share,
    clearance,
    is_mounting_face,
)
from contactsense.localization.local_prior import DeviationCells
from contactsense.localization.simd_neighbourhood import QUADRATURE_POINTS, QUADRATURE_WEIGHTS
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.robots.surface.union import distances
from contactsense.robots.vectors import vector
from contactsense.solvers.posterior.contact_prior import Prior


class BodyFrames(NamedTuple):
    """Body frames of all primitives in the base frame, in one posture."""

    rotation: np.ndarray
    """Orientations, shape (P, 3, 3)."""
    origin: np.ndarray
    """Origins, shape (P, 3) [m]."""


def body_frames(surfaces: Surfaces, rotation: np.ndarray, origin: np.ndarray) -> BodyFrames:
    """Frames of the primitives where the links have `rotation` (n + 1, 3, 3) and `origin` (n + 1, 3)."""
    link = np.minimum(surfaces.link, len(origin) - 1)
    return BodyFrames(
        rotation[link] @ surfaces.rotation,
        np.einsum("pij,pj->pi", rotation[link], surfaces.origin) + origin[link],
    )


def log_accessible_share(
    surfaces: Surfaces,
    deviations: DeviationCells,
    prior: Prior,
    link: int,
    point: np.ndarray,
    covariance: np.ndarray,
    rotation: np.ndarray,
    origin: np.ndarray,
) -> float:
    """Logarithm of the fraction of a place's neighbourhood that can be touched in one posture.

    Args:
        surfaces: Primitives of all links.
        deviations: Where their surface is on average.
        prior: Prior of contacts.
        link: The link.
        point: The place, link frame, shape (3,) [m].
        covariance: Its covariance, shape (3, 3) [m^2].
        rotation, origin: Poses of all links in the base frame, shapes (n + 1, 3, 3) and (n + 1, 3).
    """
    d, _, normal = distances(surfaces, point[None], link)
    n = normal[0]
    on_surface = point - d[0] * n
    basis = np.linalg.svd(n[None])[2][1:]
    values, vectors = np.linalg.eigh(basis @ covariance @ basis.T)
    around = on_surface + (QUADRATURE_POINTS * np.sqrt(np.maximum(values, 0.0))) @ (basis.T @ vectors).T
    d, which, normal = distances(surfaces, around, link)
    around -= d[:, None] * normal
    body = min(link, len(origin) - 1)
    places, normals = around @ rotation[body].T + origin[body], normal @ rotation[body].T
    share = np.empty(len(places))
    _shares(
        surfaces, deviations, body_frames(surfaces, rotation, origin), prior, which, places, normals, share
    )
    height = rotation[body][2] @ on_surface + origin[body][2]
    if is_mounting_face(link, height, float(rotation[body][2] @ n), 2.0 * prior.surface_deviation):
        return -math.inf
    return math.log(float(QUADRATURE_WEIGHTS @ share) / float(QUADRATURE_WEIGHTS.sum()))


@kernel
def _shares(
    surfaces: Surfaces,
    deviations: DeviationCells,
    frames: BodyFrames,
    prior: Prior,
    which: np.ndarray,
    points: np.ndarray,
    normals: np.ndarray,
    share: np.ndarray,
) -> None:
    for i in range(points.shape[0]):
        place, normal = vector(points[i]), vector(normals[i])
        free = clearance(surfaces, deviations, frames, which[i], place, normal, prior.clearance, 0.0)
        share[i] = accessible_share(free, prior)
