"""Bodies composed of parts of ellipsoids, cylinders, cones and planes, joined smoothly or at edges.

The paper's section 7: the complete surface of each part is solved in closed form, and the contact is the
solution that lies on its part. A convex body has at most one. There is none if the wrench acts on a sharp
edge or corner; then the wrench axis gives the point where the force enters.
"""

from math import sqrt

import numpy as np

from contactsense.solvers.cylinder import solve_cone, solve_cylinder
from contactsense.solvers.ellipsoid import solve_ellipsoid
from contactsense.solvers.plane import solve_plane
from contactsense.solvers.solution import (
    MISS,
    OK,
    SHARP,
    Answer,
    input_status,
    no_contact,
)
from contactsense.solvers.typed_kernel import kernel
from contactsense.solvers.wrench_axis import (
    wrench_axis_cone,
    wrench_axis_cylinder,
    wrench_axis_ellipsoid,
    wrench_axis_plane,
)

PLANE, ELLIPSOID, CYLINDER, CONE = range(4)
"""Kinds of surface; their sizes are those that the kernels take, filled up to four."""

_PATCH_TOLERANCE = 1e-9
"""Tolerance of a contact outside its part, relative to the size of the body, for rounding errors."""

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
def outside_distance(
    kind: int, size: np.ndarray, rotation: np.ndarray, origin: np.ndarray, x: float, y: float, z: float
) -> float:
    """Approximate distance of a point outside a surface, negative behind it."""
    x, y, z = _inward(rotation, x - origin[0], y - origin[1], z - origin[2])
    if kind == PLANE:
        return float(size[0] * x + size[1] * y + size[2] * z - size[3])
    if kind == ELLIPSOID:
        u, v, w = x / size[0], y / size[1], z / size[2]
        return float((sqrt(u * u + v * v + w * w) - 1.0) * min(size[0], size[1], size[2]))
    return float((sqrt(x * x + y * y) - size[0] + size[1] * z) / sqrt(1.0 + size[1] * size[1]))


@kernel
def _solve_part(
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
    """Solve the complete surface of a part in its frame."""
    ox, oy, oz = origin[0], origin[1], origin[2]
    gx, gy, gz = _inward(rotation, fx, fy, fz)
    lx, ly, lz = _inward(
        rotation, mx - (oy * fz - oz * fy), my - (oz * fx - ox * fz), mz - (ox * fy - oy * fx)
    )
    a, b, c, d = size[0], size[1], size[2], size[3]
    if kind == PLANE:
        if exact:
            solution = solve_plane(gx, gy, gz, lx, ly, lz, a, b, c, d)
        else:
            solution = wrench_axis_plane(gx, gy, gz, lx, ly, lz, a, b, c, d)
    elif kind == ELLIPSOID:
        if exact:
            solution = solve_ellipsoid(gx, gy, gz, lx, ly, lz, a, b, c)
        else:
            solution = wrench_axis_ellipsoid(gx, gy, gz, lx, ly, lz, a, b, c)
    elif kind == CYLINDER:
        if exact:
            solution = solve_cylinder(gx, gy, gz, lx, ly, lz, a)
        else:
            solution = wrench_axis_cylinder(gx, gy, gz, lx, ly, lz, a)
    elif exact:
        solution = solve_cone(gx, gy, gz, lx, ly, lz, a, b)
    else:
        solution = wrench_axis_cone(gx, gy, gz, lx, ly, lz, a, b)
    status, cx, cy, cz, nx, ny, nz, xi, residual, condition = solution
    cx, cy, cz = _outward(rotation, cx, cy, cz)
    nx, ny, nz = _outward(rotation, nx, ny, nz)
    return status, ox + cx, oy + cy, oz + cz, nx, ny, nz, xi, residual, condition


@kernel
def _best_part(
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
    """The part whose solution is nearest to it: distance outside the part, and the answer."""
    lowest = _FAR
    best = no_contact(MISS)
    for part in range(border.shape[0]):
        solution = _solve_part(
            exact, kind[part], size[part], rotation[part], origin[part], fx, fy, fz, mx, my, mz
        )
        if solution[0] != OK or not abs(solution[1]) + abs(solution[2]) + abs(solution[3]) < _FAR:
            continue
        outside = -_FAR
        for k in border[part]:
            if k < 0:
                break
            over = outside_distance(
                kind[k], size[k], rotation[k], origin[k], solution[1], solution[2], solution[3]
            )
            outside = max(outside, over)
            if outside >= lowest:
                break
        if outside < lowest:
            lowest, best = outside, solution
    return lowest, best


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
        See `contactsense.solvers.solution`. `SHARP` where the wrench acts on an edge or corner, at the point
        where its axis enters; a miss without a nearest point.
    """
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    seam = _PATCH_TOLERANCE * reach
    outside, solution = _best_part(True, fx, fy, fz, mx, my, mz, kind, size, rotation, origin, border, reach)
    if outside <= seam:
        return solution
    outside, solution = _best_part(False, fx, fy, fz, mx, my, mz, kind, size, rotation, origin, border, reach)
    if outside <= seam:
        return SHARP, *solution[1:]
    return no_contact(MISS)


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
    """Point where the wrench axis enters such a body; arguments as of `solve_compound`."""
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    outside, solution = _best_part(False, fx, fy, fz, mx, my, mz, kind, size, rotation, origin, border, reach)
    return solution if outside <= _PATCH_TOLERANCE * reach else no_contact(MISS)
