"""Compiled geometry of convex primitives: signed distance, nearest point, normal, curvature, support point.

All of `contactsense.robots.primitives` come down to three kinds, each a convex core plus a ball
(Minkowski sum), so that a normal exists everywhere:

- `REVOLVED`: a trapezoid (-h, 0), (-h, R0), (h, R1), (h, 0) in the (z, rho) half plane, turned about z, plus
  a ball of radius r: sphere, capsule, cylinder, tapered cylinder. `size` = (h, R0, R1, r).
- `ELLIPSOID`: `size` = its three semi-axes.
- `BOX`: half lengths of the core and a ball of radius r. `size` = (b_x, b_y, b_z, r).

The kernels take one primitive's kind and size and work in its body frame, in floats, without allocation. They
are total: every finite input gets a finite answer, on the axis and at the centre too, where a nearest point
is not unique and one is picked.
"""

from collections.abc import Sequence
from math import fabs, sqrt
from typing import Annotated, NamedTuple

import numpy as np

from contactsense.robots.jit.declaration import Floats, Integers
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.primitives import Box, Capsule, Cylinder, Ellipsoid, Primitive, Sphere
from contactsense.robots.robot import Link
from contactsense.robots.rotations import frame_along, rotation_from_rpy
from contactsense.robots.surface.ellipsoid_projection import Dimensions, Projection, nearest_on_ellipsoid
from contactsense.robots.vectors import Vector

ShapeOperator = tuple[float, float, float, float, float, float]
"""Result of `curvature`."""

REVOLVED = 0
ELLIPSOID = 1
BOX = 2

SAME_NORMAL = 1e-8
"""Sine of the angle below which two normals count as one, to distinguish a face from the adjacent rim."""

TOUCHING = 1e-9
"""Distance from a core [m] below which the direction away from it is only rounding."""


class Surfaces(NamedTuple):
    """Primitives of several links in contiguous arrays; those of link i are `start[i]` to `start[i + 1]`."""

    kind: Annotated[Integers, "primitives"]
    """`REVOLVED`, `ELLIPSOID` or `BOX`."""
    link: Annotated[Integers, "primitives"]
    """Number of the link that carries the primitive, base 0."""
    rotation: Annotated[Floats, "primitives, 3, 3"]
    """Axes of the body frame in the link frame, as columns."""
    origin: Annotated[Floats, "primitives, 3"]
    """Origin of the body frame in the link frame [m]."""
    size: Annotated[Floats, "primitives, 8"]
    """Dimensions by kind, see the module's text [m], unused ones zero."""
    radius: Annotated[Floats, "primitives"]
    """Radius of the ball about `origin` that holds the primitive [m]."""
    start: Annotated[Integers, "links + 1"]
    """First primitive of each link, and their number at the end."""


def pack(links: Sequence[Link], coarse: bool = False) -> Surfaces:
    """Put the primitives of all links, in order, into arrays for the kernels.

    Args:
        links: Base first.
        coarse: Whether to take each link's coarse level, where it has one.
    """
    chosen = [link.coarse if coarse and link.coarse else link.primitives for link in links]
    shapes = [(number, shape) for number, own in enumerate(chosen) for shape in own]
    counts = [len(own) for own in chosen]
    kind = np.zeros(len(shapes), dtype=np.int64)
    rotation = np.zeros((len(shapes), 3, 3))
    origin = np.zeros((len(shapes), 3))
    size = np.zeros((len(shapes), 8))
    radius = np.zeros(len(shapes))
    for i, (_, shape) in enumerate(shapes):
        kind[i], rotation[i], origin[i], dimensions = body(shape)
        size[i, : len(dimensions)] = dimensions
        radius[i] = bounding_radius(kind[i], size[i])
    return Surfaces(
        kind=kind,
        link=np.array([number for number, _ in shapes], dtype=np.int64),
        rotation=rotation,
        origin=origin,
        size=size,
        radius=radius,
        start=np.concatenate(([0], np.cumsum(counts))).astype(np.int64),
    )


def body(shape: Primitive) -> tuple[int, np.ndarray, np.ndarray, tuple[float, ...]]:
    """Kernel kind, orientation (3, 3) and origin (3,) of the body frame in the link frame, and the size."""
    if isinstance(shape, Sphere):
        return REVOLVED, np.eye(3), np.array(shape.center), (0.0, 0.0, 0.0, shape.radius)
    if isinstance(shape, Capsule):
        frame, centre, length = _along(shape.a, shape.b)
        return REVOLVED, frame, centre, (length / 2.0, 0.0, 0.0, shape.radius)
    if isinstance(shape, Cylinder):
        frame, centre, _ = _along(shape.a, shape.b)
        return REVOLVED, frame, centre, (*shape.core(), shape.rounding)
    if isinstance(shape, Ellipsoid):
        return ELLIPSOID, rotation_from_rpy(shape.rpy), np.array(shape.center), shape.radii
    if isinstance(shape, Box):
        core = tuple(half - shape.rounding for half in shape.half)
        return BOX, rotation_from_rpy(shape.rpy), np.array(shape.center), (*core, shape.rounding)
    raise TypeError(f"no geometry for {type(shape).__name__}")


def _along(a: Sequence[float], b: Sequence[float]) -> tuple[np.ndarray, np.ndarray, float]:
    """Frame with z from `a` to `b`, the middle between them, and their distance."""
    start, end = np.array(a), np.array(b)
    return frame_along(end - start), (start + end) / 2.0, float(np.linalg.norm(end - start))


@kernel
def bounding_radius(kind: int, size: Dimensions) -> float:
    """Radius of the ball about the body frame's origin that holds a primitive [m]."""
    if kind == REVOLVED:
        across = max(size[1], size[2])
        return sqrt(size[0] * size[0] + across * across) + size[3]
    if kind == ELLIPSOID:
        return max(size[0], max(size[1], size[2]))
    return sqrt(size[0] * size[0] + size[1] * size[1] + size[2] * size[2]) + size[3]


@kernel
def keep_valid(kind: int, size: np.ndarray, least: float) -> None:
    """Clip dimensions in place to what a body can have: no negative core, no ball or ellipsoid below `least`
    [m]."""
    for i in range(4):
        size[i] = max(size[i], 0.0)
    if kind == ELLIPSOID:
        size[3] = 0.0
        for i in range(3):
            size[i] = max(size[i], least)
    else:
        size[3] = max(size[3], least)


@kernel
def project(kind: int, size: Dimensions, x: float, y: float, z: float) -> Projection:
    """Nearest surface point of a primitive.

    Args:
        kind: `REVOLVED`, `ELLIPSOID` or `BOX`.
        size: Dimensions of the primitive, shape (8,).
        x, y, z: Query point, body frame [m].

    Returns:
        Signed distance (negative inside) [m], nearest surface point (3 floats) [m] and the outward unit
        normal there (3 floats), body frame.
    """
    if kind == REVOLVED:
        return _project_revolved(size, x, y, z)
    if kind == ELLIPSOID:
        return nearest_on_ellipsoid(size, x, y, z)
    return _project_box(size, x, y, z)


@kernel
def out_of_reach(kind: int, size: Dimensions, x: float, y: float, z: float, reach: float) -> bool:
    """Whether a point is more than `reach` [m] away from a primitive for sure (or less deep inside, where it
    is negative): by the can about a body of revolution, in a fraction of the time of `project`.

    Args:
        kind, size: The primitive, as for `project`.
        x, y, z: The point, body frame [m].
        reach: Distance [m].
    """
    if kind != REVOLVED:
        return False
    along, across = size[0] + size[3] + reach, max(size[1], size[2]) + size[3] + reach
    return across <= 0.0 or fabs(z) > along or x * x + y * y > across * across


@kernel
def _project_revolved(size: Dimensions, x: float, y: float, z: float) -> Projection:
    h, R0, R1, r = size[0], size[1], size[2], size[3]
    rho = sqrt(x * x + y * y)
    if rho > 0.0:
        ux, uy = x / rho, y / rho
    else:
        ux, uy = 1.0, 0.0
    # Slanted side of the core: direction (dz, dr), outward normal (-dr, dz), offset s of the query from its
    # line.
    dz, dr = 2.0 * h, R1 - R0
    length = sqrt(dz * dz + dr * dr)
    if length > 0.0:
        dz, dr = dz / length, dr / length
    else:
        dz = 1.0
    s = (rho - R0) * dz - (z + h) * dr
    top = fabs(z) - h
    distance = 0.0
    if s > 0.0 or top > 0.0:
        if z > h and rho <= R1:
            qz, qr = h, rho
        elif z < -h and rho <= R0:
            qz, qr = -h, rho
        else:
            t = min(max((z + h) * dz + (rho - R0) * dr, 0.0), length)
            qz, qr = t * dz - h, R0 + t * dr
        ez, er = z - qz, rho - qr
        distance = sqrt(ez * ez + er * er)
    if distance > TOUCHING:
        nz, nr = ez / distance, er / distance
    else:
        # Inside the core, or so near to it that rounding decides: the face whose plane is nearest.
        if s >= top:
            distance, nz, nr = s, -dr, dz
        else:
            distance, nz, nr = top, (1.0 if z > 0.0 else -1.0), 0.0
        qz, qr = z - distance * nz, rho - distance * nr
    pr = qr + r * nr
    return distance - r, pr * ux, pr * uy, qz + r * nz, nr * ux, nr * uy, nz


@kernel
def _project_box(size: Dimensions, x: float, y: float, z: float) -> Projection:
    bx, by, bz, r = size[0], size[1], size[2], size[3]
    sx = 1.0 if x >= 0.0 else -1.0
    sy = 1.0 if y >= 0.0 else -1.0
    sz = 1.0 if z >= 0.0 else -1.0
    ox, oy, oz = fabs(x) - bx, fabs(y) - by, fabs(z) - bz
    ex, ey, ez = max(ox, 0.0), max(oy, 0.0), max(oz, 0.0)
    distance = sqrt(ex * ex + ey * ey + ez * ez)
    if distance <= TOUCHING:
        # Inside the core, or so near to it that rounding decides: the face whose plane is nearest.
        if ox >= oy and ox >= oz:
            return ox - r, sx * (bx + r), y, z, sx, 0.0, 0.0
        if oy >= oz:
            return oy - r, x, sy * (by + r), z, 0.0, sy, 0.0
        return oz - r, x, y, sz * (bz + r), 0.0, 0.0, sz
    nx, ny, nz = sx * ex / distance, sy * ey / distance, sz * ez / distance
    px = sx * min(fabs(x), bx) + r * nx
    py = sy * min(fabs(y), by) + r * ny
    pz = sz * min(fabs(z), bz) + r * nz
    return distance - r, px, py, pz, nx, ny, nz


@kernel
def curvature(
    kind: int, size: Dimensions, px: float, py: float, pz: float, nx: float, ny: float, nz: float
) -> ShapeOperator:
    """Shape operator of a primitive at a surface point: how the outward normal turns with a step on the
    surface.

    Args:
        kind: `REVOLVED`, `ELLIPSOID` or `BOX`.
        size: Dimensions of the primitive, shape (8,).
        px, py, pz: Point on the surface, body frame [m].
        nx, ny, nz: Outward unit normal there, body frame.

    Returns:
        W_xx, W_xy, W_xz, W_yy, W_yz, W_zz [1/m], body frame: dn = W dp for tangent dp, W n = 0. On a seam
        between a face and its rim, where it jumps, that of the flat side.
    """
    if kind == REVOLVED:
        return _curvature_revolved(size, px, py, nx, ny, nz)
    if kind == ELLIPSOID:
        aa, bb, cc = size[0] * size[0], size[1] * size[1], size[2] * size[2]
        gradient = sqrt((px / aa) ** 2 + (py / bb) ** 2 + (pz / cc) ** 2)
        return _tangential(1.0 / (aa * gradient), 1.0 / (bb * gradient), 1.0 / (cc * gradient), nx, ny, nz)
    # On a rounded box the directions that bend are those in which the normal leans: none on a face beside its
    # own normal, two on an edge, three on a corner. A core without length in a direction bends there too.
    k = 1.0 / size[3] if size[3] > 0.0 else 0.0
    kx = k if fabs(nx) > SAME_NORMAL or size[0] <= 0.0 else 0.0
    ky = k if fabs(ny) > SAME_NORMAL or size[1] <= 0.0 else 0.0
    kz = k if fabs(nz) > SAME_NORMAL or size[2] <= 0.0 else 0.0
    return _tangential(kx, ky, kz, nx, ny, nz)


@kernel
def _tangential(kx: float, ky: float, kz: float, nx: float, ny: float, nz: float) -> ShapeOperator:
    """Six numbers of P diag(k) P with P = 1 - n n^T."""
    kn = kx * nx * nx + ky * ny * ny + kz * nz * nz
    return (
        kx - 2.0 * kx * nx * nx + kn * nx * nx,
        -(kx + ky) * nx * ny + kn * nx * ny,
        -(kx + kz) * nx * nz + kn * nx * nz,
        ky - 2.0 * ky * ny * ny + kn * ny * ny,
        -(ky + kz) * ny * nz + kn * ny * nz,
        kz - 2.0 * kz * nz * nz + kn * nz * nz,
    )


@kernel
def _curvature_revolved(
    size: Dimensions, px: float, py: float, nx: float, ny: float, nz: float
) -> ShapeOperator:
    h, R0, R1, r = size[0], size[1], size[2], size[3]
    rho = sqrt(px * px + py * py)
    k = 1.0 / r if r > 0.0 else 0.0
    nr = sqrt(nx * nx + ny * ny)
    if nr <= SAME_NORMAL:
        # On the axis: a flat cap, or the pole of a ball.
        if (nz > 0.0 and R1 > 0.0) or (nz <= 0.0 and R0 > 0.0):
            return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        return k, 0.0, 0.0, k, 0.0, 0.0
    around = nr / max(rho, r * nr)
    dz, dr = 2.0 * h, R1 - R0
    length = sqrt(dz * dz + dr * dr)
    # (nz, nr) along the slanted side's normal (-dr, dz): no bend along the meridian.
    flat = length > 0.0 and fabs(nz * dz + nr * dr) <= SAME_NORMAL * length
    along = 0.0 if flat else k
    # Circle's tangent (-ny, nx, 0) / nr and meridian's tangent n x that = (-nx nz, -ny nz, nr^2) / nr.
    cx, cy = -ny / nr, nx / nr
    mx, my = -nx * nz / nr, -ny * nz / nr
    return (
        around * cx * cx + along * mx * mx,
        around * cx * cy + along * mx * my,
        along * mx * nr,
        around * cy * cy + along * my * my,
        along * my * nr,
        along * nr * nr,
    )


@kernel
def support(kind: int, size: Dimensions, dx: float, dy: float, dz: float) -> Vector:
    """Surface point farthest along a direction.

    Args:
        kind: `REVOLVED`, `ELLIPSOID` or `BOX`.
        size: Dimensions of the primitive, shape (8,).
        dx, dy, dz: Direction, body frame, any length but zero.

    Returns:
        The point (3 floats), body frame [m]; the middle of a flat face that is square to the direction.
    """
    norm = sqrt(dx * dx + dy * dy + dz * dz)
    if norm > 0.0:
        dx, dy, dz = dx / norm, dy / norm, dz / norm
    else:
        dz = 1.0
    if kind == REVOLVED:
        h, R0, R1, r = size[0], size[1], size[2], size[3]
        across = sqrt(dx * dx + dy * dy)
        if h * dz + R1 * across >= -h * dz + R0 * across:
            qz, qr = h, R1
        else:
            qz, qr = -h, R0
        radial = qr / across if across > 0.0 else 0.0
        return (radial + r) * dx, (radial + r) * dy, qz + r * dz
    if kind == ELLIPSOID:
        aa, bb, cc = size[0] * size[0], size[1] * size[1], size[2] * size[2]
        scale = sqrt(aa * dx * dx + bb * dy * dy + cc * dz * dz)
        return aa * dx / scale, bb * dy / scale, cc * dz / scale
    r = size[3]
    qx = size[0] if dx > 0.0 else (-size[0] if dx < 0.0 else 0.0)
    qy = size[1] if dy > 0.0 else (-size[1] if dy < 0.0 else 0.0)
    qz = size[2] if dz > 0.0 else (-size[2] if dz < 0.0 else 0.0)
    return qx + r * dx, qy + r * dy, qz + r * dz
