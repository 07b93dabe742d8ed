"""What the URDFs of all arms have: poses, limits, meshes."""

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

_GRID = 1e-7
"""Vertices that are closer than this are one vertex [m]: the files repeat them for each facet's normal."""


def pose(element: ElementTree.Element | None) -> tuple[np.ndarray, np.ndarray]:
    """Translation (3,) [m] and rotation (3, 3) of an element's origin; none if it states none."""
    origin = None if element is None else element.find("origin")
    if origin is None:
        return np.zeros(3), np.eye(3)
    xyz, rpy = (np.array(origin.attrib[name].split(), dtype=float) for name in ("xyz", "rpy"))
    return xyz, Rotation.from_euler("xyz", rpy).as_matrix()


def limits(joints: Sequence[ElementTree.Element]) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest positions, shape (2, n) [rad], and speeds, shape (n,) [rad/s], of joints."""
    found = [limit for joint in joints if (limit := joint.find("limit")) is not None]
    positions = [[float(limit.attrib[end]) for limit in found] for end in ("lower", "upper")]
    return np.array(positions), np.array([float(limit.attrib["velocity"]) for limit in found])


def mesh(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices, shape (V, 3) [m], and facets, shape (F, 3), of a file, equal vertices merged, facets without
    area left out.

    Raises:
        ValueError: no facet is left.
    """
    found = trimesh.load(path, force="mesh", process=False, skip_materials=True)
    assert isinstance(found, trimesh.Trimesh)
    keys, place = np.unique(np.round(np.asarray(found.vertices) / _GRID), axis=0, return_inverse=True)
    vertices = keys * _GRID
    faces = place.reshape(-1)[np.asarray(found.faces)]
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    faces = faces[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 0.0]
    if len(faces) == 0:
        raise ValueError(f"{path}: the mesh has no surface")
    return vertices, faces


def symmetric(xx: float, xy: float, xz: float, yy: float, yz: float, zz: float) -> np.ndarray:
    """An inertia tensor, shape (3, 3), from its six components."""
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
