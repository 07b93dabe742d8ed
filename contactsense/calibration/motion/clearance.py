"""Distances of an arm from itself and from the plane that it stands on.

The surface of each link is represented by the samples of `contactsense.localization.surface.surface_samples`,
about 35 mm apart; an edge between two of them may be a few millimetres closer than reported.
"""

import numpy as np

from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import empty_motion
from contactsense.robots.surface.union import distances
from contactsense.scene import Scene
from contactsense.scene_model.constants import build_constants


class Clearance:
    """Distances within the arm of one scene, tool included."""

    def __init__(self, scene: Scene, home: np.ndarray, min_distance: float) -> None:
        """Prepare the geometry.

        Args:
            scene: The arm.
            home: A collision-free posture, shape (n,) [rad]. Links that are closer than `min_distance` in it
                are adjacent by construction and ignored.
            min_distance: Distance to keep [m].
        """
        constants = build_constants(scene.model_copy(update={"touchable": None, "link_prior": "area"}))
        self._model, self._surfaces, self._depth = (
            constants.model,
            constants.surfaces,
            constants.sensors.depth,
        )
        links = len(self._depth)
        first = [constants.samples.start[constants.surfaces.start[k]] for k in range(links + 1)]
        self._points = [constants.samples.point[first[k] : first[k + 1]] for k in range(links)]
        self._pairs = [(a, b) for b in range(links) for a in range(b - 1) if len(self._points[b])]
        near = self._between(*self._poses(home[None]))
        self._pairs = [
            pair for pair, distance in zip(self._pairs, near[0], strict=True) if distance >= min_distance
        ]

    def lowest(self, q: np.ndarray) -> np.ndarray:
        """Height of the lowest point of all moving links above the plane z = 0 of the base frame.

        The first moving link rotates on the base at a constant height and is ignored.

        Args:
            q: Postures, shape (N, n) [rad].

        Returns:
            Shape (N,) [m].
        """
        rotation, origin = self._poses(q)
        found = np.full(len(q), np.inf)
        for link, points in enumerate(self._points):
            body = self._depth[link]
            if body >= 2 and len(points):
                z = points @ rotation[:, body, 2].T + origin[:, body, 2]
                found = np.minimum(found, z.min(axis=0))
        return found

    def nearest(self, q: np.ndarray) -> np.ndarray:
        """Smallest distance between two links that are not adjacent, negative for penetration.

        Args:
            q: Postures, shape (N, n) [rad].

        Returns:
            Shape (N,) [m]; infinite without such links.
        """
        return np.asarray(np.min(self._between(*self._poses(q)), axis=1, initial=np.inf))

    def _poses(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        n = q.shape[1]
        motion = empty_motion(n)
        rotation, origin = np.empty((len(q), n + 1, 3, 3)), np.empty((len(q), n + 1, 3))
        for i, row in enumerate(np.ascontiguousarray(q, dtype=float)):
            forward_kinematics(self._model, row, motion)
            rotation[i], origin[i] = motion.rotation, motion.origin
        return rotation, origin

    def _between(self, rotation: np.ndarray, origin: np.ndarray) -> np.ndarray:
        """Distance of every pair of links in every posture, shape (N, pairs)."""
        found = np.full((len(rotation), len(self._pairs)), np.inf)
        for column, (a, b) in enumerate(self._pairs):
            A, B = self._depth[a], self._depth[b]
            base = np.einsum("nij,pj->npi", rotation[:, B], self._points[b]) + origin[:, None, B]
            local = np.einsum("nji,npj->npi", rotation[:, A], base - origin[:, None, A])
            distance, _, _ = distances(self._surfaces, local.reshape(-1, 3), a)
            found[:, column] = distance.reshape(local.shape[:2]).min(axis=1)
        return found
