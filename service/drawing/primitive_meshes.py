"""Triangle meshes of convex primitives, with vertices on their surface.

A primitive is a stack of rings about its z axis, closed by a point at either end. Seen from the side, the
rings of a body of revolution follow its outline; those of a box run around its rounded corners.
"""

from math import acos, ceil, pi

import numpy as np

from contactsense.robots.surface.convex_primitives import ELLIPSOID, REVOLVED, Surfaces
from contactsense.robots.surface.union import distances
from contactsense.service.drawing.mesh import Mesh
from contactsense.service.drawing.triangles import refined

DEVIATION = 0.0002
"""Distance of the faces from a round surface, about [m]."""
SPACING = 0.025
"""Largest distance between rings along a body of revolution [m]."""
_HIDDEN = 2.5 * DEVIATION
"""Faces that lie deeper than this in the primitives of their link are left out [m]. Where a primitive is
round in both directions, the middle of its own faces is twice the deviation deep."""


def surface_mesh(surfaces: Surfaces, link: int) -> Mesh:
    """Mesh of the primitives of one link, link frame; without the faces that lie inside other primitives.

    Args:
        surfaces: Primitives of all links.
        link: Number of the link.
    """
    whole = Mesh.joined([_placed(surfaces, p) for p in range(surfaces.start[link], surfaces.start[link + 1])])
    if len(whole.faces) == 0:
        return whole
    hidden = _depth(surfaces, link, whole.vertices[whole.faces]) < -_HIDDEN
    a, b, c = (whole.vertices[whole.faces[:, i]] for i in range(3))
    flat = np.linalg.norm(np.cross(b - a, c - a), axis=1) < 1e-12
    return whole.with_faces(~flat & ~hidden.all(axis=1))


def outer_triangles(surfaces: Surfaces, link: int, mesh: Mesh, edge: float = 0.004) -> np.ndarray:
    """The triangles of a link's mesh that lie on its surface, shape (T, 3, 3) [m].

    Triangles that another primitive of the link cuts are refined, and their parts inside it left out.

    Args:
        surfaces: Primitives of all links.
        link: Number of the link.
        mesh: Its `surface_mesh`.
        edge: Longest edge where primitives meet [m].
    """

    def place(triangles: np.ndarray) -> np.ndarray:
        hidden = _depth(surfaces, link, triangles) < -_HIDDEN
        return np.asarray(1 - hidden.any(axis=1).astype(np.int64) - hidden.all(axis=1))

    found = refined(mesh.vertices[mesh.faces], edge, place)
    return np.asarray(found[place(found) == 1])


def _depth(surfaces: Surfaces, link: int, triangles: np.ndarray) -> np.ndarray:
    """Signed distance of corners, middles of edges and centres of triangles (T, 3, 3), shape (T, 7) [m]."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    places = np.stack((a, b, c, (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0, (a + b + c) / 3.0), axis=1)
    return np.asarray(distances(surfaces, places.reshape(-1, 3), link)[0].reshape(-1, 7))


def _placed(surfaces: Surfaces, p: int) -> Mesh:
    """Mesh of primitive number p, link frame."""
    own = _mesh(int(surfaces.kind[p]), surfaces.size[p])
    return Mesh(own.vertices @ surfaces.rotation[p].T + surfaces.origin[p], own.faces)


def _mesh(kind: int, size: np.ndarray) -> Mesh:
    """Mesh of one primitive, body frame; kind and size as in `Surfaces`."""
    if kind == REVOLVED:
        return _revolved(*size[:4])
    if kind == ELLIPSOID:
        sphere = _revolved(0.0, 0.0, 0.0, 1.0, scale=float(size[:3].max()))
        return Mesh(sphere.vertices * size[:3], sphere.faces)
    return _box(size[:3], float(size[3]))


def _steps(angle: float, radius: float) -> int:
    """Number of chords of an arc [rad] that stay within `DEVIATION` of it."""
    return max(ceil(angle / (2.0 * acos(max(1.0 - DEVIATION / max(radius, 1e-9), 0.7)))), 1)


def _revolved(h: float, R0: float, R1: float, r: float, scale: float = 1.0) -> Mesh:
    """A truncated cone about z from -h to h with radii R0 and R1, plus a ball of radius r; fine enough for it
    to be drawn larger by `scale`."""
    around = max(_steps(2.0 * pi, scale * (max(R0, R1) + r)), 12)
    along = np.hypot(2.0 * h, R1 - R0)
    # Angle of the slanted side's normal above the xy plane.
    lean = float(np.arctan2(R0 - R1, 2.0 * h)) if along > 0.0 else 0.0
    below = np.linspace(-pi / 2.0, lean, 1 + _steps(pi / 2.0 + lean, scale * r))
    above = np.linspace(lean, pi / 2.0, 1 + _steps(pi / 2.0 - lean, scale * r))
    lower = np.column_stack((R0 + r * np.cos(below), -h + r * np.sin(below)))
    upper = np.column_stack((R1 + r * np.cos(above), h + r * np.sin(above)))
    between = np.linspace(0.0, 1.0, 1 + ceil(along / SPACING))[1:-1, None]
    outline = np.concatenate((lower, lower[-1] + between * (upper[0] - lower[-1]), upper))
    turn = np.linspace(0.0, 2.0 * pi, around, endpoint=False)
    rho, z = outline[:, :1], np.broadcast_to(outline[:, 1:], (len(outline), around))
    rings = np.stack((rho * np.cos(turn), rho * np.sin(turn), z), axis=-1)
    return _closed(rings, np.array([0.0, 0.0, -h - r]), np.array([0.0, 0.0, h + r]))


def _box(core: np.ndarray, r: float) -> Mesh:
    """A box with half lengths `core` (3,), plus a ball of radius r."""
    quarter = np.linspace(0.0, pi / 2.0, 1 + _steps(pi / 2.0, r))
    turn = np.concatenate([quarter + k * pi / 2.0 for k in range(4)])
    corner = np.repeat(np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]), len(quarter), axis=0) * core[:2]
    rings = []
    for side, lifts in ((-1.0, quarter - pi / 2.0), (1.0, quarter)):
        for lift in lifts:
            flat = corner + r * np.cos(lift) * np.column_stack((np.cos(turn), np.sin(turn)))
            height = np.full(len(turn), side * core[2] + r * np.sin(lift))
            rings.append(np.column_stack((flat, height)))
    end = np.array([0.0, 0.0, core[2] + r])
    return _closed(np.array(rings), -end, end)


def _closed(rings: np.ndarray, bottom: np.ndarray, top: np.ndarray) -> Mesh:
    """Rings of points, counterclockwise seen from above, shape (R, M, 3), closed by two points (3,)."""
    count, around = rings.shape[:2]
    here = np.arange(around)
    after = (here + 1) % around
    faces = [np.column_stack((np.full(around, count * around), after, here))]
    for k in range(count - 1):
        low, high = k * around, (k + 1) * around
        faces.append(np.column_stack((low + here, low + after, high + after)))
        faces.append(np.column_stack((low + here, high + after, high + here)))
    last = (count - 1) * around
    faces.append(np.column_stack((np.full(around, count * around + 1), last + here, last + after)))
    points = np.concatenate((rings.reshape(-1, 3), bottom[None], top[None]))
    return Mesh(points, np.concatenate(faces).astype(np.int64))
