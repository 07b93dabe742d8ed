"""How much of the neighbourhood of a place can be touched while a contact lasts: the rule of
`contactsense.localization.candidates.accessibility` for a place estimated from all samples of a contact."""

import math

import numpy as np

from contactsense.kinematics.model import Motion
from contactsense.localization.candidates.accessibility import (
    accessible_share,
    clearance,
    is_mounting_face,
)
from contactsense.localization.candidates.simd_neighbourhood import QUADRATURE_POINTS, QUADRATURE_WEIGHTS
from contactsense.localization.surface.local_prior import DeviationCells
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.localization.surface.primitive_frames import PrimitiveFrames, place_primitives
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.robots.surface.union import distances
from contactsense.robots.vectors import vector
from contactsense.solvers.posterior.contact_prior import Prior


def log_accessible_share(
    surfaces: Surfaces,
    deviations: DeviationCells,
    prior: Prior,
    link: int,
    point: np.ndarray,
    covariance: np.ndarray,
    depth: np.ndarray,
    motion: Motion,
) -> float:
    """Logarithm of the fraction of a place's neighbourhood that can be touched in one posture.

    Args:
        surfaces: Primitives of all links.
        deviations: Where their surface is on average.
        prior: Prior of contacts.
        link: The link.
        point: The place, link frame, shape (3,) [m].
        covariance: Its covariance, shape (3, 3) [m^2].
        depth: Body of each link, see `contactsense.isolation.link_hypotheses.SensorModel`.
        motion: Poses of the bodies.
    """
    d, _, normal = distances(surfaces, point[None], link)
    n = normal[0]
    on_surface = point - d[0] * n
    basis = np.linalg.svd(n[None])[2][1:]
    values, vectors = np.linalg.eigh(basis @ covariance @ basis.T)
    around = on_surface + (QUADRATURE_POINTS * np.sqrt(np.maximum(values, 0.0))) @ (basis.T @ vectors).T
    d, which, normal = distances(surfaces, around, link)
    around -= d[:, None] * normal
    frames = zeros(PrimitiveFrames, primitives=len(surfaces.kind))
    _place(surfaces, depth, motion, frames)
    rotation, origin = motion.rotation[depth[link]], motion.origin[depth[link]]
    places, normals = around @ rotation.T + origin, normal @ rotation.T
    share = np.empty(len(places))
    surface = PlacedSurface(surfaces, deviations, frames)
    _shares(surface, prior, which, places, normals, share)
    height = rotation[2] @ on_surface + origin[2]
    if is_mounting_face(link, height, float(rotation[2] @ n), 2.0 * prior.surface_deviation):
        return -math.inf
    return math.log(float(QUADRATURE_WEIGHTS @ share) / float(QUADRATURE_WEIGHTS.sum()))


@kernel
def _place(surfaces: Surfaces, depth: np.ndarray, motion: Motion, frames: PrimitiveFrames) -> None:
    """`place_primitives`, as Python calls it."""
    place_primitives(surfaces, depth, motion, frames)


@kernel
def _shares(
    surface: PlacedSurface,
    prior: Prior,
    which: np.ndarray,
    points: np.ndarray,
    normals: np.ndarray,
    share: np.ndarray,
) -> None:
    for i in range(points.shape[0]):
        place, normal = vector(points[i]), vector(normals[i])
        free = clearance(surface, which[i], place, normal, prior.clearance, 0.0)
        share[i] = accessible_share(free, prior)
