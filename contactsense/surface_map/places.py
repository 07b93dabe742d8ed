"""Places of an arm's surface in one posture that something can touch, with the shape of the surface there."""

from typing import NamedTuple

import numpy as np

from contactsense.kinematics.model import Motion
from contactsense.localization.surface.surface_samples import MOUNTING_HEIGHT, SurfaceSamples, cover_distances
from contactsense.robots.rotations import symmetric
from contactsense.robots.surface.convex_primitives import Surfaces, curvature
from contactsense.robots.surface.signed_distance_grid import Grids, intersect_skin
from contactsense.robots.surface.union import distances
from contactsense.robots.vectors import vector
from contactsense.runtime.candidate_rows import SKIN_STEPS, SKIN_TOLERANCE
from contactsense.scene_model.constants import Constants


class Places(NamedTuple):
    """N places, base frame."""

    link: np.ndarray
    """Index of the link, shape (N,), int64."""
    point: np.ndarray
    """Point of the surface, shape (N, 3) [m]."""
    normal: np.ndarray
    """Outward unit normal, shape (N, 3)."""
    tangents: np.ndarray
    """Two unit tangents as columns, shape (N, 3, 2)."""
    turn: np.ndarray
    """Change of the normal per step along each tangent, as columns, shape (N, 3, 2) [1/m]."""
    share: np.ndarray
    """Share of the cell in the surface of all N places, shape (N,)."""
    friction_ratio: np.ndarray
    """Prior standard deviation of tangential over normal force along each tangent, the tilt of the real
    surface included, shape (N,)."""


def touchable_places(constants: Constants, motion: Motion) -> Places:
    """Samples of the surface that can be touched in one posture.

    A place that another body covers has no free height for a finger above it (`Scene.clearance`); neither
    covered places nor the mounting face of the base can be touched.

    Args:
        constants: Of the scene.
        motion: Poses of the links.
    """
    surfaces, samples, depth = constants.surfaces, constants.samples, constants.sensors.depth
    link = surfaces.link[samples.primitive]
    rotation, origin = motion.rotation[depth[link]], motion.origin[depth[link]]
    point = origin + np.einsum("nij,nj->ni", rotation, samples.point)
    normal = np.einsum("nij,nj->ni", rotation, samples.normal)
    above = point + constants.prior.clearance * normal
    free = cover_distances(surfaces, above) > 0.0
    free &= ~((link == 0) & (point[:, 2] < MOUNTING_HEIGHT) & (normal[:, 2] < -0.5))
    for other, body in enumerate(depth):
        if surfaces.start[other] < surfaces.start[other + 1]:
            seen = (above - motion.origin[body]) @ motion.rotation[body]
            free &= distances(surfaces, seen, other)[0] > 0.0
    tangents = _tangents(normal)
    turn = rotation @ _shape_operators(surfaces, samples) @ rotation.transpose(0, 2, 1) @ tangents
    share = np.exp(samples.log_share[free])
    return Places(
        link=link[free],
        point=point[free],
        normal=normal[free],
        tangents=tangents[free],
        turn=turn[free],
        share=share / share.sum(),
        friction_ratio=np.hypot(constants.prior.friction_ratio, samples.tilt[free]),
    )


def on_skin(places: Places, skin: Grids, constants: Constants, motion: Motion) -> np.ndarray:
    """Where a push along each inward normal touches the skin: the localizer's answers are there. The place
    itself where no skin is near.

    Args:
        places: The N places.
        skin: Of the scene, as `contactsense.scene_model.skin_grids.skin_of` makes it.
        constants, motion: As for `touchable_places`.

    Returns:
        Shape (N, 3), base frame [m].
    """
    found = places.point.copy()
    for i in np.flatnonzero(places.link < len(skin.shape)):
        link = int(places.link[i])
        body = constants.sensors.depth[link]
        rotation, origin = motion.rotation[body], motion.origin[body]
        point = vector(rotation.T @ (places.point[i] - origin))
        distance, point, _ = intersect_skin(
            skin, link, point, vector(rotation.T @ places.normal[i]), SKIN_STEPS
        )
        if abs(distance) < SKIN_TOLERANCE:
            found[i] = origin + rotation @ point
    return found


def _tangents(normal: np.ndarray) -> np.ndarray:
    """Two unit tangents per normal, shape (N, 3, 2)."""
    axis = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    first = np.cross(normal, axis)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack((first, np.cross(normal, first)), axis=2)


def _shape_operators(surfaces: Surfaces, samples: SurfaceSamples) -> np.ndarray:
    """Shape operator of the surface at each sample, link frame, shape (N, 3, 3) [1/m]."""
    found = np.zeros((len(samples.point), 3, 3))
    for i, p in enumerate(samples.primitive):
        axes = surfaces.rotation[p]
        place = (samples.point[i] - surfaces.origin[p]) @ axes
        bend = curvature(surfaces.kind[p], surfaces.size[p], *place, *(samples.normal[i] @ axes))
        found[i] = axes @ symmetric(bend) @ axes.T
    return found
