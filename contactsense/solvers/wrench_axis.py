"""The wrench axis (paper, section 4): where the force's line enters a surface, as if there were no torsion.

The line is that of the wrench less its moment along the force. These answers report no torsion; what the wrench
has of it shows in their residual.
"""

from math import sqrt
from typing import Any

from numba import njit

from contactsense.solvers.answer import (
    LARGE,
    MISS,
    NOT_FINITE,
    OK,
    SMALL,
    Answer,
    finish,
    nothing,
    unusable,
)
from contactsense.solvers.capsule import project_tapered_capsule
from contactsense.solvers.cylinder import solve_cylinder
from contactsense.solvers.nearest import Projection, nearest_to_line
from contactsense.solvers.plane import solve_plane


@njit(cache=True, error_model="numpy")
def line_moment(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float
) -> tuple[float, float, float]:
    """The moment without its part along the force: that of a pure force on the same line."""
    pitch = (fx * mx + fy * my + fz * mz) / (fx * fx + fy * fy + fz * fz)
    return mx - pitch * fx, my - pitch * fy, mz - pitch * fz


@njit(cache=True, error_model="numpy")
def wrench_axis_ellipsoid(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, a: float, b: float, c: float
) -> Answer:
    """Where the wrench axis enters an ellipsoid about the origin with semi-axes `a`, `b`, `c` (paper, (5) and (6)).

    On a miss the point nearest to the line, measured in the ellipsoid's own metric.
    """
    ff = fx * fx + fy * fy + fz * fz
    mm = mx * mx + my * my + mz * mz
    if not (SMALL < ff < LARGE and mm < LARGE):
        status = unusable(fx, fy, fz, mx, my, mz)
        if status != OK:
            return nothing(status)
        # Only the ratio of moment to force counts, and one division brings it into range.
        size = max(abs(fx), abs(fy), abs(fz))
        fx, fy, fz, mx, my, mz = fx / size, fy / size, fz / size, mx / size, my / size, mz / size
        ff = fx * fx + fy * fy + fz * fz
    # In units of the semi-axes the ellipsoid is the unit sphere: line r + s u.
    ux, uy, uz = fx / a, fy / b, fz / c
    rx = (fy * mz - fz * my) / (ff * a)
    ry = (fz * mx - fx * mz) / (ff * b)
    rz = (fx * my - fy * mx) / (ff * c)
    uu = ux * ux + uy * uy + uz * uz
    shift = (rx * ux + ry * uy + rz * uz) / uu
    rx, ry, rz = rx - shift * ux, ry - shift * uy, rz - shift * uz
    inside = 1.0 - (rx * rx + ry * ry + rz * rz)
    status = OK
    if inside > 0.0:
        step = sqrt(inside / uu)
        x, y, z = rx - step * ux, ry - step * uy, rz - step * uz
    else:
        status = MISS
        size = sqrt(1.0 - inside)
        x, y, z = rx / size, ry / size, rz / size
    nx, ny, nz = x / a, y / b, z / c
    slope = sqrt(nx * nx + ny * ny + nz * nz)
    return finish(
        status, fx, fy, fz, mx, my, mz, a * x, b * y, c * z, nx / slope, ny / slope, nz / slope, 0.0, 0.0, 0.0
    )


@njit(cache=True, error_model="numpy")
def wrench_axis_sphere(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, radius: float
) -> Answer:
    """Where the wrench axis enters a sphere about the origin (paper, section 5.1.1, K = 0)."""
    return wrench_axis_ellipsoid(fx, fy, fz, mx, my, mz, radius, radius, radius)


@njit(cache=True, error_model="numpy")
def _without_torsion(
    answer: Answer, fx: float, fy: float, fz: float, mx: float, my: float, mz: float
) -> Answer:
    """The answer to the line's moment, held against the whole moment."""
    status, cx, cy, cz, nx, ny, nz, _, _, _ = answer
    if nx == 0.0 and ny == 0.0 and nz == 0.0:
        return answer
    return finish(status, fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz, 0.0, 0.0, 0.0)


@njit(cache=True, error_model="numpy")
def wrench_axis_cylinder(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, radius: float
) -> Answer:
    """Where the wrench axis enters an infinite cylinder about z."""
    lx, ly, lz = line_moment(fx, fy, fz, mx, my, mz)
    return _without_torsion(solve_cylinder(fx, fy, fz, lx, ly, lz, radius), fx, fy, fz, mx, my, mz)


@njit(cache=True, error_model="numpy")
def wrench_axis_plane(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    nx: float,
    ny: float,
    nz: float,
    offset: float,
) -> Answer:
    """Where the wrench axis meets the plane n.c = offset."""
    lx, ly, lz = line_moment(fx, fy, fz, mx, my, mz)
    answer = solve_plane(fx, fy, fz, lx, ly, lz, nx, ny, nz, offset)
    return _without_torsion(answer, fx, fy, fz, mx, my, mz)


_STEPS = 60


# No cache: a compiled function among the arguments defeats it.
@njit(error_model="numpy")
def enter(
    project: Projection,
    size: Any,
    reach: float,
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
) -> Answer:
    """Where the wrench axis enters a convex body that is given by its projection.

    Along a line the signed distance is convex, so Newton's method from outside runs into the first root without
    passing it, or shows that there is none.

    Args:
        project: Projection on the body.
        size: First argument of `project`.
        reach: Radius of a ball about the origin that holds the body.
        fx, fy, fz, mx, my, mz: Wrench on the body.
    """
    status = unusable(fx, fy, fz, mx, my, mz)
    if status != OK:
        return nothing(status)
    size_of_force = max(abs(fx), abs(fy), abs(fz))
    fx, fy, fz = fx / size_of_force, fy / size_of_force, fz / size_of_force
    mx, my, mz = mx / size_of_force, my / size_of_force, mz / size_of_force
    if not max(abs(mx), abs(my), abs(mz)) < LARGE:
        return nothing(NOT_FINITE)
    ff = fx * fx + fy * fy + fz * fz
    px, py, pz = (fy * mz - fz * my) / ff, (fz * mx - fx * mz) / ff, (fx * my - fy * mx) / ff
    # In units of the force: the line is r + s f, and outside of the ball before s = -reach / |f|.
    at = -2.0 * reach / sqrt(ff)
    for _ in range(_STEPS):
        distance, cx, cy, cz, nx, ny, nz = project(size, px + at * fx, py + at * fy, pz + at * fz)
        push = nx * fx + ny * fy + nz * fz
        if push >= 0.0:
            return nearest_to_line(project, size, reach, fx, fy, fz, mx, my, mz)
        step = -distance / push
        at += step
        if step <= 1e-16 * (reach + abs(at)):
            break
    return finish(OK, fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz, 0.0, 0.0, 0.0)


@njit(cache=True, error_model="numpy")
def wrench_axis_tapered_capsule(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    half: float,
    radius_a: float,
    radius_b: float,
) -> Answer:
    """Where the wrench axis enters the convex hull of two balls on z."""
    size = (half, radius_a, radius_b)
    reach = half + max(radius_a, radius_b)
    return enter(project_tapered_capsule, size, reach, fx, fy, fz, mx, my, mz)


@njit(cache=True, error_model="numpy")
def wrench_axis_capsule(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, half: float, radius: float
) -> Answer:
    """Where the wrench axis enters a capsule about z."""
    return wrench_axis_tapered_capsule(fx, fy, fz, mx, my, mz, half, radius, radius)
