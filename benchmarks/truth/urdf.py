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
    xyz, rpy = (np.array(origin.attrib.get(name, "0 0 0").split(), dtype=float) for name in ("xyz", "rpy"))
    return xyz, Rotation.from_euler("xyz", rpy).as_matrix()


def limits(joints: Sequence[ElementTree.Element], path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest positions, shape (2, n) [rad], and speeds, shape (n,) [rad/s], of the joints of a
    file; one turn for joints without end.

    Raises:
        ValueError: a joint states no limit.
    """
    positions, speeds = np.empty((2, len(joints))), np.empty(len(joints))
    for j, joint in enumerate(joints):
        stated = joint.find("limit")
        ends = ("-3.14159265", "3.14159265") if joint.attrib["type"] == "continuous" else (None, None)
        found = {} if stated is None else stated.attrib
        values = (found.get("lower", ends[0]), found.get("upper", ends[1]), found.get("velocity"))
        for name, value in zip(("lower", "upper", "velocity"), values, strict=True):
            if value is None:
                raise ValueError(
                    f"{path}: joint {joint.attrib['name']}: expected a limit with {name}, found none"
                )
        positions[0, j], positions[1, j], speeds[j] = (float(value) for value in values if value is not None)
    return positions, speeds


def mesh_path(name: str, urdf: Path) -> Path:
    """Where the mesh is that a URDF names: beside it, or, if the name begins with a package, in a folder of
    that name above it.

    Raises:
        ValueError: there is no such folder.
    """
    if not name.startswith("package://"):
        return urdf.parent / name.removeprefix("file://")
    inside = name.removeprefix("package://")
    for folder in urdf.resolve().parents:
        if (folder / inside).is_file():
            return folder / inside
    raise ValueError(f"{urdf}: {name}: expected this file below a folder above the URDF, found none")


def solid(shape: ElementTree.Element, path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices, shape (V, 3) [m], and facets, shape (F, 3), of a box, cylinder or sphere of a URDF.

    Raises:
        ValueError: it is none of these.
    """
    size = {name: [float(number) for number in text.split()] for name, text in shape.attrib.items()}
    if shape.tag == "box":
        made = trimesh.creation.box(size["size"])
    elif shape.tag == "cylinder":
        made = trimesh.creation.cylinder(radius=size["radius"][0], height=size["length"][0])
    elif shape.tag == "sphere":
        made = trimesh.creation.icosphere(radius=size["radius"][0])
    else:
        raise ValueError(f"{path}: geometry {shape.tag}: expected mesh, box, cylinder or sphere")
    return np.asarray(made.vertices), np.asarray(made.faces)


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
