"""Build the signed-distance grids of `contactsense.robots.surface.signed_distance_grid` from meshes, and
cache them."""

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from contactsense.robots.decomposition.distance_samples import Shape
from contactsense.robots.decomposition.outer_skin import Skin, outer_skin, sample
from contactsense.robots.errors import RobotError
from contactsense.robots.robot import Robot
from contactsense.robots.surface.signed_distance_grid import BAND, Grids, read, write

CELL = 0.0035
"""Distance between neighbouring nodes [m]."""

_DENSITY = 1.2e6
"""Samples on a mesh per square metre."""


def build(robot: Robot, meshes: Mapping[str, trimesh.Trimesh], cell: float = CELL) -> Grids:
    """Grids of all links.

    Args:
        robot: Provides the names of the links, in order.
        meshes: Visual surface by link, in its frame [m]; links without one get no nodes.
        cell: Distance between neighbouring nodes [m].

    Raises:
        ValueError: a mesh has no surface visible from outside.
    """
    parts, shapes, lows = [], [], []
    for name in robot.link_names:
        if name not in meshes:
            parts.append(np.zeros(0, dtype=np.float32))
            shapes.append((0, 0, 0))
            lows.append(np.zeros(3))
            continue
        mesh = meshes[name]
        low = mesh.bounds[0] - BAND
        counts = np.ceil((mesh.bounds[1] + BAND - low) / cell).astype(int) + 1
        axes = [low[i] + cell * np.arange(counts[i]) for i in range(3)]
        nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        distance = Shape(dense_skin(mesh)).distance(nodes)
        parts.append(np.clip(distance, -BAND, BAND).astype(np.float32))
        shapes.append(tuple(counts))
        lows.append(low)
    return Grids(
        values=np.concatenate(parts),
        start=np.concatenate(([0], np.cumsum([len(part) for part in parts]))).astype(np.int64),
        shape=np.array(shapes, dtype=np.int64),
        low=np.array(lows),
        cell=cell,
    )


def dense_skin(mesh: trimesh.Trimesh) -> Skin:
    """Densely sampled outer skin of a mesh: samples that are close to a coarser sampling of it and have
    similar normals."""
    coarse = outer_skin(mesh, count=30000)
    rng = np.random.default_rng(1)
    points, normals = sample(mesh, int(np.clip(_DENSITY * mesh.area, 50000, 600000)), rng)
    far, near = (np.asarray(found) for found in cKDTree(coarse.points).query(points))
    facing = np.einsum("ij,ij->i", normals, coarse.normals[near])
    keep = (far < 3.0 * np.sqrt(coarse.area / len(coarse.points))) & (np.abs(facing) > 0.7)
    normals = normals * np.sign(facing)[:, None]
    return Skin(points[keep], normals[keep], np.ones(keep.sum()), coarse.area)


def cached(robot: Robot, meshes: Mapping[str, trimesh.Trimesh], folder: Path | None = None) -> Grids:
    """Grids of a robot from the cache; they are built first if they are missing.

    Args:
        robot: Provides the names of the links.
        meshes: Visual surface by link, in its frame [m].
        folder: Folder of the cache; by default `contactsense` in `XDG_CACHE_HOME` or `~/.cache`.

    Raises:
        RobotError: the cache cannot be written.
    """
    if folder is None:
        folder = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "contactsense"
    path = folder / f"{robot.name}-{_fingerprint(robot, meshes)}.npy"
    if not path.exists():
        try:
            write(build(robot, meshes), path)
        except OSError as error:
            raise RobotError(f"{path}: cannot be written: {error.strerror}") from error
    return read(path)


def _fingerprint(robot: Robot, meshes: Mapping[str, trimesh.Trimesh]) -> str:
    digest = hashlib.sha256(f"{CELL} {BAND} {_DENSITY}".encode())
    for name in robot.link_names:
        # Links without a mesh too: grids are found by the number of the link.
        digest.update(name.encode())
        if name in meshes:
            digest.update(np.ascontiguousarray(meshes[name].vertices).tobytes())
            digest.update(np.ascontiguousarray(meshes[name].faces).tobytes())
    return digest.hexdigest()[:16]
