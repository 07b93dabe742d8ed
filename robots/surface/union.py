"""Signed distance to a union of primitives: the nearest primitive and its distance."""

import numpy as np

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.surface.convex_primitives import Surfaces, project


@kernel
def nearest(kind, rotation, origin, size, radius, first, last, x, y, z):  # type: ignore[no-untyped-def]
    """Nearest of the primitives `first` to `last` - 1 to a point, as a union: inside several, the deepest.

    Args:
        kind, rotation, origin, size, radius: Arrays of `Surfaces`.
        first, last: Range of primitives.
        x, y, z: Point, link frame [m].

    Returns:
        Signed distance (inf without primitives) [m], number of the primitive (-1 without), nearest surface
        point (3 floats) [m] and outward unit normal there (3 floats), link frame.
    """
    best, which = np.inf, -1
    px, py, pz, nx, ny, nz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(first, last):
        dx, dy, dz = x - origin[i, 0], y - origin[i, 1], z - origin[i, 2]
        # The primitive's bounding ball is no nearer than the best so far.
        margin = best + radius[i]
        if margin <= 0.0 or dx * dx + dy * dy + dz * dz >= margin * margin:
            continue
        R = rotation[i]
        bx = R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz
        by = R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz
        bz = R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz
        d, sx, sy, sz, mx, my, mz = project(kind[i], size[i], bx, by, bz)
        if d < best:
            best, which = d, i
            px, py, pz, nx, ny, nz = sx, sy, sz, mx, my, mz
    if which >= 0:
        R = rotation[which]
        return (
            best,
            which,
            R[0, 0] * px + R[0, 1] * py + R[0, 2] * pz + origin[which, 0],
            R[1, 0] * px + R[1, 1] * py + R[1, 2] * pz + origin[which, 1],
            R[2, 0] * px + R[2, 1] * py + R[2, 2] * pz + origin[which, 2],
            R[0, 0] * nx + R[0, 1] * ny + R[0, 2] * nz,
            R[1, 0] * nx + R[1, 1] * ny + R[1, 2] * nz,
            R[2, 0] * nx + R[2, 1] * ny + R[2, 2] * nz,
        )
    return best, which, px, py, pz, nx, ny, nz


@kernel
def _distances(kind, rotation, origin, size, radius, first, last, points, distance, which, normal):  # type: ignore[no-untyped-def]
    for i in range(points.shape[0]):
        d, k, _, _, _, nx, ny, nz = nearest(
            kind, rotation, origin, size, radius, first, last, points[i, 0], points[i, 1], points[i, 2]
        )
        distance[i], which[i] = d, k
        normal[i, 0], normal[i, 1], normal[i, 2] = nx, ny, nz


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
    _distances(
        surfaces.kind,
        surfaces.rotation,
        surfaces.origin,
        surfaces.size,
        surfaces.radius,
        first,
        last,
        points,
        distance,
        which,
        normal,
    )
    return distance, which, normal
