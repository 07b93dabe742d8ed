"""The outer skin of a link: points on its visual mesh that a finger can reach, with outward normals.

Visual meshes are open, nested and full of inner parts, and the winding order of their facets is not reliable.
Whether a finger can reach a point is determined by visibility: from a point on the skin, a large part of the
hemisphere above it is free.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import trimesh
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh

NEAR = 0.02
"""The ray along the normal is free for this far [m]: there is room for a finger tip."""
AROUND = 0.04
"""Other rays count as free when nothing is within this distance [m]."""
OPEN = 0.4
"""Minimum fraction of the (cosine-weighted) hemisphere that is free above a point that can be touched."""

SHUT = 0.9
"""Minimum fraction of directions in which something is hit from a point that is shut in: joints have gaps."""

_RAYS = 48
_DIRECTIONS = 256
"""Number of rays for the fraction of free directions: its standard deviation is 0.03."""
_FAR = 1e3
_LIFT = 2e-5
"""Rays start this far above the surface [m], so as not to hit it."""


class OutOfReachError(ValueError):
    """A mesh has no part that a finger can reach."""


class Skin(NamedTuple):
    """Random points, uniform by area, on the outer skin of one link, in the link's frame."""

    points: np.ndarray
    """Shape (N, 3) [m]."""
    normals: np.ndarray
    """Outward unit normals of the facets, shape (N, 3)."""
    exposure: np.ndarray
    """Fraction of the neighbours' poses in which the point can be touched, shape (N,), 0 to 1."""
    area: float
    """Area of the whole skin [m^2]."""


class Surroundings:
    """Obstacles for a finger on one link: its neighbours, with one set of meshes for each of their poses."""

    def __init__(self, mesh: trimesh.Trimesh, poses: Sequence[Sequence[trimesh.Trimesh]] = ((),)) -> None:
        """`mesh`: mesh of the link itself; `poses`: meshes of its neighbours in its frame, one set for each
        pose."""
        self._own = _Rays([mesh])
        self._others = [_Rays(meshes) for meshes in poses]
        self._all = [_Rays([mesh, *meshes]) for meshes in poses]

    def exposure(self, points: np.ndarray, normals: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Fraction of the poses in which each point of the skin can be touched, shape (N,).

        Args:
            points, normals: Shape (N, 3) each, in the link's frame.
            rng: Random number generator for the rays' directions.
        """
        visible = [scene.openness(points, normals, rng) > 0.0 for scene in self._all]
        return np.asarray(np.mean(visible, axis=0))

    def freedom(self, points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Fraction of all directions in which rays from arbitrary points miss the link itself, shape (N,).

        About one half or more outside, little inside, even in a shell that is open at one end.
        """
        directions = rng.normal(size=(len(points) * _DIRECTIONS, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        blocked = self._own.blocked(np.repeat(points, _DIRECTIONS, axis=0), directions, _FAR)
        return np.asarray(1.0 - blocked.reshape(-1, _DIRECTIONS).mean(axis=1))

    def enclosed(self, points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Whether arbitrary points are shut in by the link and its neighbours in all poses, shape (N,).

        Such a space is part of the inside of the arm, as the recess that holds the hub of the next link.
        """
        directions = rng.normal(size=(len(points) * _RAYS, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        starts = np.repeat(points, _RAYS, axis=0)
        shut = np.ones(len(points), dtype=bool)
        for scene in self._all:
            blocked = scene.blocked(starts, directions, _FAR).reshape(-1, _RAYS)
            shut &= blocked.mean(axis=1) >= SHUT
        return shut

    def exposure_of_model(
        self, points: np.ndarray, normals: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """The same for points on primitives. For points slightly below the skin, the skin is ignored.

        A face inside a joint, above which all space is shut in, is not exposed, though rays find its gap.
        """
        beneath = self._own.blocked(points, normals, NEAR)
        visible = [
            np.where(
                beneath,
                others.openness(points, normals, rng) > 0.0,
                both.openness(points, normals, rng) > 0.0,
            )
            for others, both in zip(self._others, self._all, strict=True)
        ]
        shut_in = self.enclosed(points + NEAR / 2.0 * normals, rng)
        return np.asarray(np.where(shut_in, 0.0, np.mean(visible, axis=0)))


def outer_skin(
    mesh: trimesh.Trimesh,
    poses: Sequence[Sequence[trimesh.Trimesh]] = ((),),
    count: int = 30000,
    seed: int = 0,
) -> Skin:
    """Sample the outer skin of a mesh.

    Args:
        mesh: Surface of the link, in its own frame [m].
        poses: Meshes of the neighbours in the link's frame, one set for each of their poses.
        count: Number of samples on the whole mesh; those on inner parts are dropped.
        seed: Seed of the samples and rays.

    Raises:
        OutOfReachError: no part of the mesh is visible from outside.
        ValueError: the mesh has no area.
    """
    if len(mesh.faces) == 0 or not mesh.area > 0.0:
        raise ValueError("the mesh has no surface")
    rng = np.random.default_rng(seed)
    points, normals = sample(mesh, count, rng)
    alone = _Rays([mesh])
    above = alone.openness(points, normals, rng)
    below = alone.openness(points, -normals, rng)
    normals[below > above] *= -1.0
    outside = np.maximum(above, below) > 0.0
    if not outside.any():
        raise OutOfReachError("no part of the mesh is visible from outside")
    points, normals = points[outside], normals[outside]
    exposure = Surroundings(mesh, poses).exposure(points, normals, rng)
    return Skin(points, normals, exposure, float(mesh.area * outside.mean()))


def sample(mesh: trimesh.Trimesh, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Points uniform by area on a mesh, shape (count, 3), and the unit normals of their facets."""
    corners = np.asarray(mesh.triangles, dtype=np.float64)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice_area = np.linalg.norm(cross, axis=1)
    faces = rng.choice(len(corners), size=count, p=twice_area / twice_area.sum())
    u, v = rng.random((2, count, 1))
    u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
    a, b, c = corners[faces, 0], corners[faces, 1], corners[faces, 2]
    return a + u * (b - a) + v * (c - a), cross[faces] / twice_area[faces, None]


class _Rays:
    """Several meshes in one structure for casting rays."""

    def __init__(self, meshes: Sequence[trimesh.Trimesh]) -> None:
        self._scene: Any = None
        if meshes:
            self._scene = rtcore_scene.EmbreeScene()
            triangles = np.concatenate([np.asarray(mesh.triangles) for mesh in meshes])
            TriangleMesh(self._scene, triangles.astype(np.float32))

    def openness(self, points: np.ndarray, normals: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Fraction of the hemisphere above each point that is free, shape (N,); zero if it cannot be touched.

        A cavity inside a shell can be wider than a finger: at least a tenth of the rays must get away
            altogether.
        """
        if self._scene is None:
            return np.full(len(points), 2.0)
        origins = points + _LIFT * normals
        straight = self.blocked(origins, normals, NEAR)
        # A uniform point on a sphere that touches the plane gives a cosine-weighted direction.
        sphere = rng.normal(size=(len(points), _RAYS, 3))
        sphere /= np.linalg.norm(sphere, axis=2, keepdims=True)
        directions = sphere + normals[:, None, :]
        directions /= np.maximum(np.linalg.norm(directions, axis=2, keepdims=True), 1e-9)
        starts, flat = np.repeat(origins, _RAYS, axis=0), directions.reshape(-1, 3)
        free = 1.0 - self.blocked(starts, flat, AROUND).reshape(-1, _RAYS).mean(axis=1)
        leaving = 1.0 - self.blocked(starts, flat, _FAR).reshape(-1, _RAYS).mean(axis=1)
        return np.where(~straight & (free >= OPEN) & (leaving >= 0.1), leaving + free, 0.0)

    def blocked(self, origins: np.ndarray, directions: np.ndarray, reach: float) -> np.ndarray:
        """Whether each ray hits something within `reach` [m], shape (N,)."""
        if self._scene is None:
            return np.zeros(len(origins), dtype=bool)
        hits = self._scene.run(
            np.ascontiguousarray(origins, dtype=np.float32),
            np.ascontiguousarray(directions, dtype=np.float32),
            dists=np.full(len(origins), reach, dtype=np.float32),
            query="OCCLUDED",
        )
        return np.asarray(hits >= 0)
