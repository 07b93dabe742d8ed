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
    xyz, rpy = (numbers(origin, name, 3, "0 0 0") for name in ("xyz", "rpy"))
    return xyz, Rotation.from_euler("xyz", rpy).as_matrix()


def numbers(element: ElementTree.Element, name: str, count: int, default: str | None = None) -> np.ndarray:
    """Numbers in an attribute of an element, shape (count,).

    Raises:
        ValueError: the attribute is missing without a default, or has something else.
    """
    text = element.attrib.get(name, default)
    try:
        found = np.array((text or "").split(), dtype=float)
    except ValueError:
        found = np.empty(0)
    if len(found) != count or not np.isfinite(found).all():
        expected = "a number" if count == 1 else f"{count} numbers"
        got = "none" if text is None else repr(text)
        raise ValueError(f"{element.tag}: {name}: expected {expected}, got {got}")
    return found


def limits(joints: Sequence[ElementTree.Element], path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest positions, shape (2, n) [rad], and speeds, shape (n,) [rad/s], of the joints of a
    file; one turn for joints without end.

    Raises:
        ValueError: a joint states no limit, or none that it can move within.
    """
    positions, speeds = np.empty((2, len(joints))), np.empty(len(joints))
    for j, joint in enumerate(joints):
        stated = joint.find("limit")
        if stated is None:
            raise ValueError(f"{path}: joint {joint.attrib['name']}: expected a limit, found none")
        turn = (f"{-np.pi}", f"{np.pi}") if joint.attrib["type"] == "continuous" else (None, None)
        try:
            positions[0, j] = numbers(stated, "lower", 1, turn[0])[0]
            positions[1, j] = numbers(stated, "upper", 1, turn[1])[0]
            speeds[j] = numbers(stated, "velocity", 1)[0]
        except ValueError as error:
            raise ValueError(f"{path}: joint {joint.attrib['name']}: {error}") from None
        if not (positions[0, j] < positions[1, j] and speeds[j] > 0.0):
            raise ValueError(
                f"{path}: joint {joint.attrib['name']}: limit: expected lower below upper and velocity above "
                f"zero, got {positions[0, j]:g}, {positions[1, j]:g} and {speeds[j]:g}"
            )
    return positions, speeds


def mesh_path(name: str, urdf: Path) -> Path:
    """Where the mesh is that a URDF names: beside it, or, if the name begins with a package, in a folder of
    that name above it. Where there is none, the package may have another name: it is any folder above.

    Raises:
        ValueError: there is no such file.
    """
    if not name.startswith("package://"):
        return urdf.parent / name.removeprefix("file://")
    named = name.removeprefix("package://")
    folders = urdf.resolve().parents
    for path in (folder / part for part in (named, named.partition("/")[2]) for folder in folders):
        if path.is_file():
            return path
    raise ValueError(f"{name}: expected this file below a folder above the URDF, found none")


def solid(shape: ElementTree.Element) -> tuple[np.ndarray, np.ndarray]:
    """Vertices, shape (V, 3) [m], and facets, shape (F, 3), of a box, cylinder or sphere of a URDF.

    Raises:
        ValueError: it is none of these.
    """
    if shape.tag == "box":
        made = trimesh.creation.box(numbers(shape, "size", 3))
    elif shape.tag == "cylinder":
        (radius,), (length,) = numbers(shape, "radius", 1), numbers(shape, "length", 1)
        made = trimesh.creation.cylinder(radius=radius, height=length)
    elif shape.tag == "sphere":
        made = trimesh.creation.icosphere(radius=numbers(shape, "radius", 1)[0])
    else:
        raise ValueError(f"geometry {shape.tag}: expected mesh, box, cylinder or sphere")
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
