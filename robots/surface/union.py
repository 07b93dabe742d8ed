"""Signed distance to a union of primitives: the nearest primitive and its distance."""

from typing import Protocol

import numpy as np

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.surface.convex_primitives import Surfaces, project
from contactsense.robots.vectors import Vector, add, dot, rotate, rotate_back, subtract, vector


class PackedPrimitives(Protocol):
    """`Surfaces`, or another tuple with these of its fields."""

    @property
    def kind(self) -> np.ndarray:
        """Kinds of the primitives."""

    @property
    def rotation(self) -> np.ndarray:
        """Axes of the body frames."""

    @property
    def origin(self) -> np.ndarray:
        """Their origins [m]."""

    @property
    def size(self) -> np.ndarray:
        """Dimensions by kind [m]."""

    @property
    def radius(self) -> np.ndarray:
        """Radii of the balls that hold the primitives [m]."""


@kernel
def nearest(
    primitives: PackedPrimitives, first: int, last: int, point: Vector
) -> tuple[float, int, Vector, Vector]:
    """Nearest of the primitives `first` to `last` - 1 to a point, as a union: inside several, the deepest.

    Args:
        primitives: The primitives, in one frame.
        first, last: Range of primitives.
        point: Point, link frame [m].

    Returns:
        Signed distance (inf without primitives) [m], number of the primitive (-1 without), nearest surface
        point [m] and outward unit normal there, link frame.
    """
    best, which = np.inf, -1
    place, normal = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for i in range(first, last):
        offset = subtract(point, vector(primitives.origin[i]))
        # The primitive's bounding ball is no nearer than the best so far.
        margin = best + primitives.radius[i]
        if margin <= 0.0 or dot(offset, offset) >= margin * margin:
            continue
        x, y, z = rotate_back(primitives.rotation[i], offset)
        d, sx, sy, sz, nx, ny, nz = project(primitives.kind[i], primitives.size[i], x, y, z)
        if d < best:
            best, which = d, i
            place, normal = (sx, sy, sz), (nx, ny, nz)
    if which >= 0:
        R = primitives.rotation[which]
        place, normal = add(rotate(R, place), vector(primitives.origin[which])), rotate(R, normal)
    return best, which, place, normal


@kernel
def _distances(
    surfaces: Surfaces,
    first: int,
    last: int,
    points: np.ndarray,
    distance: np.ndarray,
    which: np.ndarray,
    normal: np.ndarray,
) -> None:
    for i in range(points.shape[0]):
        distance[i], which[i], _, n = nearest(surfaces, first, last, vector(points[i]))
        normal[i, 0], normal[i, 1], normal[i, 2] = n


def distances(
    surfaces: Surfaces, points: np.ndarray, link: int = 0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Signed distances of points to the union of one link's primitives.

    Args:
        surfaces: Packed primitives.
        points: Shape (N, 3), link frame [m].
        link: Number of the link.

    Returns:
        Signed distance [m], shape (N,); number of the nearest primitive, shape (N,); outward unit normal at
        the nearest point, shape (N, 3).
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    distance = np.empty(len(points))
    which = np.empty(len(points), dtype=np.int64)
    normal = np.empty((len(points), 3))
    first, last = surfaces.start[link], surfaces.start[link + 1]
    _distances(surfaces, first, last, points, distance, which, normal)
    return distance, which, normal
