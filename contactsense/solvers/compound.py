"""Bodies put together from parts of ellipsoids, cylinders, cones and planes, joined smoothly or at edges.

The paper's section 7: each part's complete surface is solved in closed form, and the contact is the one that
lies on its part. A convex body has at most one. It has none where the wrench acts on a sharp edge or corner;
then the wrench axis says where the force enters.
"""

from math import sqrt

import numpy as np

from contactsense.solvers.answer import (
    MISS,
    OK,
    SHARP,
    Answer,
    nothing,
    unusable,
)
from contactsense.solvers.cylinder import solve_cone, solve_cylinder
from contactsense.solvers.ellipsoid import solve_ellipsoid
from contactsense.solvers.plane import solve_plane
from contactsense.solvers.typed import kernel
from contactsense.solvers.wrench_axis import (
    wrench_axis_cone,
    wrench_axis_cylinder,
    wrench_axis_ellipsoid,
    wrench_axis_plane,
)

PLANE, ELLIPSOID, CYLINDER, CONE = range(4)
"""Kinds of surface; their sizes are those that the kernels take, filled up to four."""

_SEAM = 1e-9
"""How far outside of its part, relative to the size of the body, a contact may lie by rounding."""

_FAR = 1e300


@kernel
def _inward(rotation: np.ndarray, x: float, y: float, z: float) -> tuple[float, float, float]:
    return (
        rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z,
        rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z,
        rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z,
    )


@kernel
def _outward(rotation: np.ndarray, x: float, y: float, z: float) -> tuple[float, float, float]:
    return (
        rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z,
        rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z,
        rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z,
    )


@kernel
def beyond(
    kind: int, size: np.ndarray, rotation: np.ndarray, origin: np.ndarray, x: float, y: float, z: float
) -> float:
    """How far a point lies outside of a surface, about; below zero it is behind it."""
    x, y, z = _inward(rotation, x - origin[0], y - origin[1], z - origin[2])
    if kind == PLANE:
        return float(size[0] * x + size[1] * y + size[2] * z - size[3])
    if kind == ELLIPSOID:
        u, v, w = x / size[0], y / size[1], z / size[2]
        return float((sqrt(u * u + v * v + w * w) - 1.0) * min(size[0], size[1], size[2]))
    return float((sqrt(x * x + y * y) - size[0] + size[1] * z) / sqrt(1.0 + size[1] * size[1]))


@kernel
def _solved(
    exact: bool,
    kind: int,
    size: np.ndarray,
    rotation: np.ndarray,
    origin: np.ndarray,
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
) -> Answer:
    """A complete surface where it stands."""
    ox, oy, oz = origin[0], origin[1], origin[2]
    gx, gy, gz = _inward(rotation, fx, fy, fz)
    lx, ly, lz = _inward(
        rotation, mx - (oy * fz - oz * fy), my - (oz * fx - ox * fz), mz - (ox * fy - oy * fx)
    )
    a, b, c, d = size[0], size[1], size[2], size[3]
    if kind == PLANE:
        if exact:
            found = solve_plane(gx, gy, gz, lx, ly, lz, a, b, c, d)
        else:
            found = wrench_axis_plane(gx, gy, gz, lx, ly, lz, a, b, c, d)
    elif kind == ELLIPSOID:
        if exact:
            found = solve_ellipsoid(gx, gy, gz, lx, ly, lz, a, b, c)
        else:
            found = wrench_axis_ellipsoid(gx, gy, gz, lx, ly, lz, a, b, c)
    elif kind == CYLINDER:
        if exact:
            found = solve_cylinder(gx, gy, gz, lx, ly, lz, a)
        else:
            found = wrench_axis_cylinder(gx, gy, gz, lx, ly, lz, a)
    elif exact:
        found = solve_cone(gx, gy, gz, lx, ly, lz, a, b)
    else:
        found = wrench_axis_cone(gx, gy, gz, lx, ly, lz, a, b)
    status, cx, cy, cz, nx, ny, nz, xi, residual, condition = found
    cx, cy, cz = _outward(rotation, cx, cy, cz)
    nx, ny, nz = _outward(rotation, nx, ny, nz)
    return status, ox + cx, oy + cy, oz + cz, nx, ny, nz, xi, residual, condition


@kernel
def _on_parts(
    exact: bool,
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    kind: np.ndarray,
    size: np.ndarray,
    rotation: np.ndarray,
    origin: np.ndarray,
    border: np.ndarray,
    reach: float,
) -> tuple[float, Answer]:
    """The least wrong part: how far outside of it, and its answer."""
    least = _FAR
    best = nothing(MISS)
    for part in range(border.shape[0]):
        found = _solved(exact, kind[part], size[part], rotation[part], origin[part], fx, fy, fz, mx, my, mz)
        if found[0] != OK or not abs(found[1]) + abs(found[2]) + abs(found[3]) < _FAR:
            continue
        outside = -_FAR
        for k in border[part]:
            if k < 0:
                break
            over = beyond(kind[k], size[k], rotation[k], origin[k], found[1], found[2], found[3])
            outside = max(outside, over)
            if outside >= least:
                break
        if outside < least:
            least, best = outside, found
    return least, best


@kernel
def solve_compound(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    kind: np.ndarray,
    size: np.ndarray,
    rotation: np.ndarray,
    origin: np.ndarray,
    border: np.ndarray,
    reach: float,
) -> Answer:
    """Contact centroid on a convex body of parts.

    Args:
        fx, fy, fz, mx, my, mz: Wrench on the body.
        kind: `PLANE`, `ELLIPSOID`, `CYLINDER` or `CONE` of each surface, shape (M,); the parts come first.
        size: Their sizes, shape (M, 4).
        rotation: Their axes as columns, shape (M, 3, 3).
        origin: Their origins, shape (M, 3).
        border: Of each part the surfaces behind which it ends, filled up with -1, shape (N, K).
        reach: Size of the body.

    Returns:
        See `contactsense.solvers.answer`. `SHARP` where the wrench acts on an edge or corner, at the point
        where its axis enters; a miss without a nearest point.
    """
    status = unusable(fx, fy, fz, mx, my, mz)
    if status != OK:
        return nothing(status)
    seam = _SEAM * reach
    outside, found = _on_parts(True, fx, fy, fz, mx, my, mz, kind, size, rotation, origin, border, reach)
    if outside <= seam:
        return found
    outside, found = _on_parts(False, fx, fy, fz, mx, my, mz, kind, size, rotation, origin, border, reach)
    if outside <= seam:
        return SHARP, *found[1:]
    return nothing(MISS)


@kernel
def wrench_axis_compound(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    kind: np.ndarray,
    size: np.ndarray,
    rotation: np.ndarray,
    origin: np.ndarray,
    border: np.ndarray,
    reach: float,
) -> Answer:
    """Where the wrench axis enters such a body; takes what `solve_compound` takes."""
    status = unusable(fx, fy, fz, mx, my, mz)
    if status != OK:
        return nothing(status)
    outside, found = _on_parts(False, fx, fy, fz, mx, my, mz, kind, size, rotation, origin, border, reach)
    return found if outside <= _SEAM * reach else nothing(MISS)
