"""Triangle meshes of an arm's primitives for drawing."""

from dataclasses import dataclass

import numpy as np

from contactsense.robots.primitives import Primitive
from contactsense.robots.rotations import rotation_from_rpy
from contactsense.robots.surface.convex_primitives import body, bounding_radius, project
from contactsense.scene import Scene

SUBDIVISIONS = 2
"""Number of subdivisions of an icosahedron's faces into four: 162 points for each primitive."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles of one link, in the link's frame; V vertices, F faces."""

    vertices: np.ndarray
    """Shape (V, 3) [m]."""
    faces: np.ndarray
    """Vertex indices, counterclockwise seen from outside, shape (F, 3), int64."""


def link_meshes(scene: Scene) -> tuple[Mesh, ...]:
    """One mesh for each of `scene.link_names`: its primitives, which may overlap."""
    shapes = [link.primitives for link in scene.robot.links]
    if len(scene.link_names) > len(shapes) and scene.tool is not None:
        shapes.append(scene.tool.primitives)
    sphere = _sphere(SUBDIVISIONS)
    return tuple(_joined([_primitive_mesh(shape, sphere) for shape in link]) for link in shapes)


def body_meshes(scene: Scene) -> tuple[Mesh, ...]:
    """One mesh for each of `scene.bodies`, in the base frame."""
    sphere = _sphere(SUBDIVISIONS)
    found = []
    for body_ in scene.bodies:
        mesh = _joined([_primitive_mesh(shape, sphere) for shape in body_.primitives])
        turned = mesh.vertices @ rotation_from_rpy(body_.rpy).T
        found.append(Mesh(turned + np.array(body_.translation), mesh.faces))
    return tuple(found)


def _primitive_mesh(shape: Primitive, sphere: Mesh) -> Mesh:
    """The points of a convex body nearest to those of a sphere around it."""
    kind, rotation, origin, size = body(shape)
    numbers = np.zeros(8)
    numbers[: len(size)] = size
    radius = 1.5 * bounding_radius(kind, numbers)
    points = np.array([project(kind, numbers, *(radius * p))[1:4] for p in sphere.vertices])
    return Mesh(points @ np.asarray(rotation).T + origin, sphere.faces)


def _joined(parts: list[Mesh]) -> Mesh:
    if not parts:
        return Mesh(np.empty((0, 3)), np.empty((0, 3), dtype=np.int64))
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    return Mesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + offset for part, offset in zip(parts, offsets, strict=True)]),
    )


def _sphere(subdivisions: int) -> Mesh:
    """The unit sphere as an icosahedron whose faces are repeatedly divided into four."""
    g = (1.0 + 5.0**0.5) / 2.0
    corners = [
        (-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g), (0, -1, -g), (0, 1, -g),
        (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1),
    ]  # fmt: skip
    faces = [
        (0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2),
        (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11),
        (6, 2, 10), (8, 6, 7), (9, 8, 1),
    ]  # fmt: skip
    points = [np.array(corner) / np.linalg.norm(corner) for corner in corners]
    for _ in range(subdivisions):
        middles: dict[tuple[int, int], int] = {}
        finer = []
        for a, b, c in faces:
            ab, bc, ca = (_middle(points, middles, *edge) for edge in ((a, b), (b, c), (c, a)))
            finer += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        faces = finer
    return Mesh(np.array(points), np.array(faces, dtype=np.int64))


def _middle(points: list[np.ndarray], middles: dict[tuple[int, int], int], a: int, b: int) -> int:
    edge = (min(a, b), max(a, b))
    if edge not in middles:
        middle = points[a] + points[b]
        middles[edge] = len(points)
        points.append(middle / np.linalg.norm(middle))
    return middles[edge]
