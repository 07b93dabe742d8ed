"""Bodies composed of parts of ellipsoids, cylinders, cones and planes, joined smoothly or at edges.

The paper's section 7: the complete surface of each part is solved in closed form, and the contact is the
solution that lies on its part. A convex body has at most one. There is none if the wrench acts on a sharp
edge or corner; then the wrench axis gives the point where the force enters.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector, rotate_back, subtract, vector
from contactsense.solvers.closed_form.cylinder import solve_cone, solve_cylinder
from contactsense.solvers.closed_form.ellipsoid import solve_ellipsoid
from contactsense.solvers.closed_form.plane import solve_plane
from contactsense.solvers.closed_form.wrench_axis import (
    wrench_axis_cone,
    wrench_axis_cylinder,
    wrench_axis_ellipsoid,
    wrench_axis_plane,
)
from contactsense.solvers.solution import (
    FAR,
    MISS,
    OK,
    PATCH_TOLERANCE,
    SHARP,
    Answer,
    input_status,
    no_contact,
    placed,
    with_status,
)
from contactsense.solvers.units import is_pure_force
from contactsense.solvers.wrench import Wrench, in_frame

PLANE, ELLIPSOID, CYLINDER, CONE = range(4)
"""Kinds of surface; their sizes are those that the kernels take, filled up to four."""


class Parts(NamedTuple):
    """Surfaces of which a convex body is composed. The first N bound it, each up to others of the M."""

    kind: np.ndarray
    """`PLANE`, `ELLIPSOID`, `CYLINDER` or `CONE` of each surface, shape (M,); the parts come first."""
    size: np.ndarray
    """Their sizes, shape (M, 4)."""
    rotation: np.ndarray
    """Their axes as columns, shape (M, 3, 3)."""
    origin: np.ndarray
    """Their origins, shape (M, 3)."""
    border: np.ndarray
    """Of each part the surfaces behind which it ends, filled up with -1, shape (N, K)."""
    reach: float
    """Size of the body."""


@kernel
def outside_distance(parts: Parts, k: int, point: Vector) -> float:
    """Approximate distance of a point outside surface k, negative behind it."""
    size = parts.size[k]
    x, y, z = rotate_back(parts.rotation[k], subtract(point, vector(parts.origin[k])))
    if parts.kind[k] == PLANE:
        return float(size[0] * x + size[1] * y + size[2] * z - size[3])
    if parts.kind[k] == ELLIPSOID:
        u, v, w = x / size[0], y / size[1], z / size[2]
        return float((sqrt(u * u + v * v + w * w) - 1.0) * min(size[0], size[1], size[2]))
    return float((sqrt(x * x + y * y) - size[0] + size[1] * z) / sqrt(1.0 + size[1] * size[1]))


@kernel
def _solve_part(exact: bool, parts: Parts, k: int, wrench: Wrench) -> Answer:
    """Solve the complete surface k in its frame."""
    rotation, origin = parts.rotation[k], vector(parts.origin[k])
    local = in_frame(wrench, rotation, origin)
    kind, size = parts.kind[k], parts.size[k]
    a, b, c, d = size[0], size[1], size[2], size[3]
    if kind == PLANE:
        solution = solve_plane(local, (a, b, c), d) if exact else wrench_axis_plane(local, (a, b, c), d)
    elif kind == ELLIPSOID:
        solution = solve_ellipsoid(local, a, b, c) if exact else wrench_axis_ellipsoid(local, a, b, c)
    elif kind == CYLINDER:
        solution = solve_cylinder(local, a) if exact else wrench_axis_cylinder(local, a)
    else:
        solution = solve_cone(local, a, b) if exact else wrench_axis_cone(local, a, b)
    return placed(solution, rotation, origin)


@kernel
def _best_part(exact: bool, parts: Parts, wrench: Wrench) -> tuple[float, Answer]:
    """The part whose solution is nearest to it: distance outside the part, and the answer."""
    lowest = FAR
    best = no_contact(MISS)
    for part in range(parts.border.shape[0]):
        solution = _solve_part(exact, parts, part, wrench)
        c = solution.centroid
        if solution.status != OK or not abs(c[0]) + abs(c[1]) + abs(c[2]) < FAR:
            continue
        outside = -FAR
        for k in parts.border[part]:
            if k < 0:
                break
            outside = max(outside, outside_distance(parts, k, c))
            if outside >= lowest:
                break
        if outside < lowest:
            lowest, best = outside, solution
    return lowest, best


@kernel
def solve_compound(wrench: Wrench, parts: Parts) -> Answer:
    """Contact centroid on a convex body of parts.

    Returns:
        See `contactsense.solvers.solution`. `SHARP` where the wrench acts on an edge or corner, at the point
        where its axis enters; a miss without a nearest point.
    """
    status = input_status(wrench)
    if status != OK:
        return no_contact(status)
    seam = PATCH_TOLERANCE * parts.reach
    twisted = not is_pure_force(wrench)
    if twisted:
        outside, solution = _best_part(True, parts, wrench)
        if outside <= seam:
            return solution
    outside, solution = _best_part(False, parts, wrench)
    if outside > seam:
        return no_contact(MISS)
    return with_status(solution, SHARP) if twisted else solution


@kernel
def wrench_axis_compound(wrench: Wrench, parts: Parts) -> Answer:
    """Point where the wrench axis enters a convex body of parts."""
    status = input_status(wrench)
    if status != OK:
        return no_contact(status)
    outside, solution = _best_part(False, parts, wrench)
    return solution if outside <= PATCH_TOLERANCE * parts.reach else no_contact(MISS)
