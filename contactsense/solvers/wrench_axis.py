"""Wrench axis (paper, section 4): the point where the force's line enters a surface, without torsion.

The line is that of the wrench without its moment along the force. These answers have no torsion; that of
the wrench appears in their residual.
"""

from math import frexp, ldexp, sqrt

from contactsense.solvers.cylinder import solve_cone, solve_cylinder
from contactsense.solvers.nearest_point import TAPERED, enter
from contactsense.solvers.plane import plane_exponent, solve_plane
from contactsense.solvers.solution import (
    LARGE,
    MISS,
    OK,
    SHARP,
    SMALL,
    Answer,
    input_status,
    make_answer,
    no_contact,
    rescaled,
    scaled,
    unit_exponents,
)
from contactsense.solvers.typed_kernel import kernel

_SMALLEST, _LARGEST = 1e-30, 1e30
"""Semi-axes between these need no other unit of length."""

_REVOLVED, _BOX = 0, 2
"""Numbers of kinds in `contactsense.robots.surface.convex_primitives`."""


@kernel
def line_moment(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float
) -> tuple[float, float, float]:
    """The moment without its part along the force: that of a pure force on the same line."""
    pitch = (fx * mx + fy * my + fz * mz) / (fx * fx + fy * fy + fz * fz)
    return mx - pitch * fx, my - pitch * fy, mz - pitch * fz


@kernel
def _ellipsoid(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, a: float, b: float, c: float
) -> Answer:
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
    return make_answer(
        status, fx, fy, fz, mx, my, mz, a * x, b * y, c * z, nx / slope, ny / slope, nz / slope, 0.0, 0.0, 0.0
    )


@kernel
def wrench_axis_ellipsoid(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, a: float, b: float, c: float
) -> Answer:
    """Where the wrench axis enters an ellipsoid about the origin with semi-axes `a`, `b`, `c`.

    That is (5) and (6) of the paper. On a miss the point nearest to the line, in the ellipsoid's own metric.
    """
    ff = fx * fx + fy * fy + fz * fz
    mm = mx * mx + my * my + mz * mz
    ordinary = min(a, b, c) > _SMALLEST and max(a, b, c) < _LARGEST
    if ordinary and SMALL < ff < LARGE and mm < LARGE:
        return _ellipsoid(fx, fy, fz, mx, my, mz, a, b, c)
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    e, g, k = unit_exponents(fx, fy, fz, mx, my, mz, max(a, b, c))
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, k)
    return rescaled(_ellipsoid(fx, fy, fz, mx, my, mz, ldexp(a, -k), ldexp(b, -k), ldexp(c, -k)), e, g, k)


@kernel
def wrench_axis_sphere(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, radius: float
) -> Answer:
    """Where the wrench axis enters a sphere about the origin (paper, section 5.1.1, K = 0)."""
    return wrench_axis_ellipsoid(fx, fy, fz, mx, my, mz, radius, radius, radius)


@kernel
def _without_torsion(
    answer: Answer, fx: float, fy: float, fz: float, mx: float, my: float, mz: float
) -> Answer:
    """Answer for the line's moment, with the residual of the whole moment."""
    status, cx, cy, cz, nx, ny, nz, _, _, _ = answer
    if nx == 0.0 and ny == 0.0 and nz == 0.0:
        return answer
    if status == SHARP:
        # Without torsion a corner is as good as any place.
        status = OK
    return make_answer(status, fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz, 0.0, 0.0, 0.0)


@kernel
def wrench_axis_cylinder(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, radius: float
) -> Answer:
    """Where the wrench axis enters an infinite cylinder about z."""
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    e, g, k = unit_exponents(fx, fy, fz, mx, my, mz, radius)
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, k)
    lx, ly, lz = line_moment(fx, fy, fz, mx, my, mz)
    answer = solve_cylinder(fx, fy, fz, lx, ly, lz, ldexp(radius, -k))
    return rescaled(_without_torsion(answer, fx, fy, fz, mx, my, mz), e, g, k)


@kernel
def wrench_axis_cone(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, radius: float, taper: float
) -> Answer:
    """Where the wrench axis enters an endless cone about z."""
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    e, g, k = unit_exponents(fx, fy, fz, mx, my, mz, radius)
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, k)
    lx, ly, lz = line_moment(fx, fy, fz, mx, my, mz)
    answer = solve_cone(fx, fy, fz, lx, ly, lz, ldexp(radius, -k), taper)
    return rescaled(_without_torsion(answer, fx, fy, fz, mx, my, mz), e, g, k)


@kernel
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
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    e = frexp(max(abs(fx), abs(fy), abs(fz)))[1]
    k = plane_exponent(mx, my, mz, offset, e)
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, e, k)
    lx, ly, lz = line_moment(fx, fy, fz, mx, my, mz)
    answer = solve_plane(fx, fy, fz, lx, ly, lz, nx, ny, nz, ldexp(offset, -k))
    return rescaled(_without_torsion(answer, fx, fy, fz, mx, my, mz), e, e, k)


@kernel
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
    size = (half, radius_a, radius_b, 0.0)
    return enter(TAPERED, size, half + max(radius_a, radius_b), fx, fy, fz, mx, my, mz)


@kernel
def wrench_axis_capsule(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, half: float, radius: float
) -> Answer:
    """Where the wrench axis enters a capsule about z."""
    return wrench_axis_tapered_capsule(fx, fy, fz, mx, my, mz, half, radius, radius)


@kernel
def wrench_axis_revolved(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    half: float,
    lower: float,
    upper: float,
    rounding: float,
) -> Answer:
    """Where the wrench axis enters a truncated cone about z plus a ball."""
    size = (half, lower, upper, rounding)
    return enter(_REVOLVED, size, half + max(lower, upper) + rounding, fx, fy, fz, mx, my, mz)


@kernel
def wrench_axis_box(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    bx: float,
    by: float,
    bz: float,
    rounding: float,
) -> Answer:
    """Where the wrench axis enters a box about the origin plus a ball."""
    size = (bx, by, bz, rounding)
    return enter(_BOX, size, bx + by + bz + rounding, fx, fy, fz, mx, my, mz)
