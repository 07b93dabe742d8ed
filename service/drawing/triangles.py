"""Triangles as arrays of corners, shape (T, 3, 3): refined, cut off, and joined to a mesh."""

from collections.abc import Callable

import numpy as np

from contactsense.service.drawing.mesh import Mesh

_SAME = 1e-6
"""Corners that are nearer to each other are one vertex [m]."""


def refined(triangles: np.ndarray, edge: float, place: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Halve the triangles that a border crosses across their longest edge until none of them is longer than
    `edge`, and leave out those beyond it.

    Args:
        triangles: Shape (T, 3, 3) [m].
        edge: Longest edge that remains at the border [m].
        place: Says of triangles (N, 3, 3) where they are, shape (N,): 1 for those within the border, -1 for
            those beyond, 0 for those that it may cross.
    """
    done = []
    while len(triangles):
        where = place(triangles)
        sides = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
        longest = np.argmax(sides, axis=1)
        split = (where == 0) & (sides[np.arange(len(sides)), longest] > edge)
        done.append(triangles[(where >= 0) & ~split])
        # Corner 0 to corner 1 is the longest side.
        order = (longest[split, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(triangles[split], order[:, :, None], axis=1), 1, 0)
        middle = (a + b) / 2.0
        triangles = np.concatenate((np.stack((a, middle, c), axis=1), np.stack((middle, b, c), axis=1)))
    return np.concatenate(done) if done else triangles


def cut_off(triangles: np.ndarray, level: np.ndarray) -> np.ndarray:
    """The parts of triangles where a value is positive that varies linearly along their edges.

    Args:
        triangles: Shape (T, 3, 3) [m].
        level: The value at each corner, shape (T, 3).
    """
    inside = level > 0.0
    count = inside.sum(axis=1)
    parts = [triangles[count == 3]]
    for wanted in (1, 2):
        chosen = count == wanted
        # The corner that differs from the other two comes first.
        single = np.argmax(inside[chosen] == (wanted == 1), axis=1)
        order = (single[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(triangles[chosen], order[:, :, None], axis=1), 1, 0)
        u, v, w = np.take_along_axis(level[chosen], order, axis=1).T[:, :, None]
        ab, ac = a + u / (u - v) * (b - a), a + u / (u - w) * (c - a)
        if wanted == 1:
            parts.append(np.stack((a, ab, ac), axis=1))
        else:
            parts += [np.stack((ab, b, c), axis=1), np.stack((ab, c, ac), axis=1)]
    return np.concatenate(parts)


def merged(triangles: np.ndarray) -> Mesh:
    """Triangles (T, 3, 3) as a mesh in which neighbours share their vertices; those without area are left
    out."""
    corners = triangles.reshape(-1, 3)
    _, first, index = np.unique(np.rint(corners / _SAME), axis=0, return_index=True, return_inverse=True)
    faces = index.reshape(-1, 3).astype(np.int64)
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return Mesh(corners[first], faces).with_faces(whole)
