"""An arm from the package index: frames, limits and visual meshes of `airo-models`, its maker's inertia.

Frames: links 0..6 are base, shoulder, upper arm, forearm and three wrists; joint j connects link j-1 to
link j and turns about z of link j. The base frame is ROS `base_link_inertia`, the base frame of the
controller; those of the others are ROS `<name>_link`.
"""

from functools import cache
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import airo_models
import numpy as np
import trimesh
import yaml
from scipy.spatial.transform import Rotation

from . import ROBOTS

LINKS = ("base", "shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
_BASE_MESH = "visual/base.obj"
"""The URDF's own mesh of the base contains a cable, which is no part of the arm."""
_GRID = 1e-7
"""Vertices that are closer than this are one vertex [m]: the files repeat them for each facet's normal."""


class Link(NamedTuple):
    """One rigid body; lengths in m, everything but the joint in its own frame."""

    name: str
    origin: np.ndarray
    """Of its joint in the link before, shape (3,); zero for the base."""
    rotation: np.ndarray
    """Of its joint in the link before, shape (3, 3)."""
    vertices: np.ndarray
    """Of the visual mesh, shape (V, 3)."""
    faces: np.ndarray
    """Rows of three vertices, counterclockwise seen from outside, shape (F, 3)."""
    mass: float
    """[kg]"""
    com: np.ndarray
    """Centre of mass, shape (3,)."""
    tensor: np.ndarray
    """Inertia about the centre of mass, shape (3, 3) [kg m^2]."""


class Arm(NamedTuple):
    """A chain of seven links and the six joints between them."""

    name: str
    links: tuple[Link, ...]
    limits: np.ndarray
    """Lowest and highest positions of the joints, shape (2, 6) [rad]."""
    speeds: np.ndarray
    """Limits of the joint speeds, shape (6,) [rad/s]."""

    @property
    def mass(self) -> float:
        """Of all links, with the base [kg]."""
        return float(sum(link.mass for link in self.links))


@cache
def read(name: str) -> Arm:
    """One of `ROBOTS`.

    Raises:
        ValueError: the package has no such arm, or a mesh has no facets.
    """
    if name not in ROBOTS:
        raise ValueError(f"{name}: no such arm; expected {' or '.join(ROBOTS)}")
    path = Path(airo_models.get_urdf_path(name))
    # An attribute there has a prefix that no namespace declares.
    urdf = ElementTree.fromstring(path.read_text(encoding="utf-8").replace("drake:", ""))
    joints = [urdf.find(f"joint[@name='{joint}_joint']") for joint in JOINTS]
    poses = [(np.zeros(3), np.eye(3)), *(_pose(joint) for joint in joints)]
    limits = [joint.find("limit") for joint in joints if joint is not None]
    with (Path(__file__).parent / "inertia.yaml").open(encoding="utf-8") as file:
        bodies = yaml.safe_load(file)[name]
    links = []
    for link, (origin, rotation), body in zip(LINKS, poses, bodies, strict=True):
        assert body["link"] == link
        mesh = path.parent / _BASE_MESH
        visual = urdf.find(f"link[@name='{link}_link{'_inertia' if link == 'base' else ''}']/visual")
        if link != "base" and visual is not None:
            mesh = path.parent / visual.find("geometry/mesh").attrib["filename"]  # type: ignore[union-attr]
        vertices, faces = _mesh(mesh)
        shift, turn = _pose(visual)
        roll = Rotation.from_euler("x", body["roll"]).as_matrix()
        xx, xy, xz, yy, yz, zz = body["tensor"]
        tensor = roll @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ roll.T
        links.append(
            Link(
                link,
                origin,
                rotation,
                vertices @ turn.T + shift,
                faces,
                float(body["mass"]),
                np.array(body["com"], dtype=float),
                tensor,
            )
        )
    return Arm(
        name,
        tuple(links),
        np.array(
            [
                [float(limit.attrib[end]) for limit in limits if limit is not None]
                for end in ("lower", "upper")
            ]
        ),
        np.array([float(limit.attrib["velocity"]) for limit in limits if limit is not None]),
    )


def _pose(element: ElementTree.Element | None) -> tuple[np.ndarray, np.ndarray]:
    """Translation and rotation of a URDF element's origin."""
    assert element is not None
    origin = element.find("origin")
    assert origin is not None
    xyz, rpy = (np.array(origin.attrib[name].split(), dtype=float) for name in ("xyz", "rpy"))
    return xyz, Rotation.from_euler("xyz", rpy).as_matrix()


def _mesh(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and facets of a file, equal vertices merged, facets without area left out."""
    mesh = trimesh.load(path, force="mesh", process=False, skip_materials=True)
    assert isinstance(mesh, trimesh.Trimesh)
    keys, place = np.unique(np.round(np.asarray(mesh.vertices) / _GRID), axis=0, return_inverse=True)
    vertices = keys * _GRID
    faces = place.reshape(-1)[np.asarray(mesh.faces)]
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    faces = faces[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 0.0]
    if len(faces) == 0:
        raise ValueError(f"{path}: the mesh has no surface")
    return vertices, faces
