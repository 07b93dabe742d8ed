"""Rounded box: six faces (planes), twelve edges (cylinders) and eight corners (spheres), in closed form.

Exactly one patch contains the contact. Most patches are excluded by one comparison: the force must push
on a face, and its line must not miss an edge. If rounding errors place the contact outside every patch,
the nearest patch is used.
"""

from math import ldexp, sqrt

from contactsense.solvers.cylinder import directions
from contactsense.solvers.ellipsoid import unit_sphere
from contactsense.solvers.nearest_point import enter, nearest_to_line
from contactsense.solvers.solution import (
    LARGE,
    NOT_CONVERGED,
    OK,
    SHARP,
    SMALL,
    Answer,
    input_status,
    invariant,
    make_answer,
    no_contact,
    rescaled,
    scaled,
    torsion,
    unit_exponents,
)
from contactsense.solvers.typed_kernel import kernel

_PATCH_TOLERANCE = 1e-9
"""Tolerance of a contact outside its patch, relative to the size of the body, for rounding errors."""

_BOX = 2
"""Index of this kind in `contactsense.robots.surface.convex_primitives`."""

_FAR = 1e300

Place = tuple[float, float, float, float, float, float, float]
"""How far outside of its patch (below zero: inside), point of the core, outward normal."""


@kernel
def _face(
    fx: float, fy: float, fz: float, mx: float, my: float, bx: float, by: float, bz: float, r: float
) -> Place:
    """Contact on the face perpendicular to z that the force pushes on."""
    if fz == 0.0:
        return _FAR, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0
    sign = -1.0 if fz > 0.0 else 1.0
    top = sign * (bz + r)
    x, y = (top * fx - my) / fz, (top * fy + mx) / fz
    return max(abs(x) - bx, abs(y) - by), x, y, sign * bz, 0.0, 0.0, sign


@kernel
def _edges(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    bx: float,
    by: float,
    bz: float,
    r: float,
    reach: float,
) -> Place:
    """Contact on the edge along z whose patch it is nearest to."""
    lowest = _FAR
    x = y = z = nx = ny = 0.0
    limit = r * r * (fx * fx + fy * fy)
    # First the edge on the side that the force comes from.
    likely = (1 if fx > 0.0 else 0) + (2 if fy > 0.0 else 0)
    for turn in range(4):
        k = likely ^ turn
        sx, sy = 1.0 - 2.0 * (k & 1), 1.0 - (k & 2)
        px, py = sx * bx, sy * by
        about = mz - (px * fy - py * fx)
        if about * about < limit:
            lx, ly = mx - py * fz, my + px * fz
            disc, a, b, u, v = directions(fx, fy, lx, ly, about, r, 0.0)
            ex, ey = a - u, b - v
            push = ex * fx + ey * fy
            if disc > 0.0 and push < 0.0:
                at = (ex * ly - ey * lx + r * fz) / push
                outside = max(abs(at) - bz, -reach * min(sx * ex, sy * ey))
                if outside < lowest:
                    lowest, x, y, z, nx, ny = outside, px, py, at, ex, ey
                    if lowest <= 0.0:
                        break
    return lowest, x, y, z, nx, ny, 0.0


@kernel
def _corners(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    bx: float,
    by: float,
    bz: float,
    r: float,
    reach: float,
) -> Place:
    """Contact on the corner whose patch it is nearest to."""
    lowest = _FAR
    x = y = z = nx = ny = nz = 0.0
    ux, uy, uz = r * fx, r * fy, r * fz
    uu = ux * ux + uy * uy + uz * uz
    tau = r * invariant(fx, fy, fz, mx, my, mz)
    likely = (1 if fx > 0.0 else 0) + (2 if fy > 0.0 else 0) + (4 if fz > 0.0 else 0)
    for turn in range(8):
        k = likely ^ turn
        sx, sy, sz = 1.0 - 2.0 * (k & 1), 1.0 - (k & 2), 1.0 - 0.5 * (k & 4)
        px, py, pz = sx * bx, sy * by, sz * bz
        lx = mx - (py * fz - pz * fy)
        ly = my - (pz * fx - px * fz)
        lz = mz - (px * fy - py * fx)
        status, ex, ey, ez, _ = unit_sphere(ux, uy, uz, lx, ly, lz, uu, lx * lx + ly * ly + lz * lz, tau)
        outside = -reach * min(sx * ex, sy * ey, sz * ez)
        if status == OK and outside < lowest:
            lowest, x, y, z, nx, ny, nz = outside, px, py, pz, ex, ey, ez
            if lowest <= 0.0:
                break
    return lowest, x, y, z, nx, ny, nz


@kernel
def _on_box(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    r: float,
    px: float,
    py: float,
    pz: float,
    nx: float,
    ny: float,
    nz: float,
    curved: int,
) -> Answer:
    """The answer at r n from the point p of the core; `curved` principal curvatures are 1 / r."""
    cx, cy, cz = px + r * nx, py + r * ny, pz + r * nz
    xi = torsion(fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz)
    bend = 1.0 / r if curved > 0 else 0.0
    det = bend * bend if curved == 2 else 0.0
    return make_answer(OK, fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz, xi, curved * bend, det)


@kernel
def patch_of_box(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    bx: float,
    by: float,
    bz: float,
    r: float,
) -> tuple[float, float, float, float, float, float, float, int]:
    """The patch that contains the contact: a `Place`, and how many of its principal curvatures are 1 / r."""
    reach = sqrt(bx * bx + by * by + bz * bz) + r
    best = _FAR
    px = py = pz = nx = ny = nz = 0.0
    curved = 0
    # Cyclic permutation: each axis in turn is z.
    for axis in range(3):
        if axis == 0:
            d, y, z, x, ey, ez, ex = _face(fy, fz, fx, my, mz, by, bz, bx, r)
        elif axis == 1:
            d, z, x, y, ez, ex, ey = _face(fz, fx, fy, mz, mx, bz, bx, by, r)
        else:
            d, x, y, z, ex, ey, ez = _face(fx, fy, fz, mx, my, bx, by, bz, r)
        if d < best:
            best, px, py, pz, nx, ny, nz = d, x, y, z, ex, ey, ez
            if best <= 0.0:
                return best, px, py, pz, nx, ny, nz, curved
    if r > 0.0:
        for axis in range(3):
            if axis == 0:
                d, y, z, x, ey, ez, ex = _edges(fy, fz, fx, my, mz, mx, by, bz, bx, r, reach)
            elif axis == 1:
                d, z, x, y, ez, ex, ey = _edges(fz, fx, fy, mz, mx, my, bz, bx, by, r, reach)
            else:
                d, x, y, z, ex, ey, ez = _edges(fx, fy, fz, mx, my, mz, bx, by, bz, r, reach)
            if d < best:
                best, px, py, pz, nx, ny, nz = d, x, y, z, ex, ey, ez
                curved = 1
                if best <= 0.0:
                    return best, px, py, pz, nx, ny, nz, curved
        d, x, y, z, ex, ey, ez = _corners(fx, fy, fz, mx, my, mz, bx, by, bz, r, reach)
        if d < best:
            best, px, py, pz, nx, ny, nz = d, x, y, z, ex, ey, ez
            curved = 2
    return best, px, py, pz, nx, ny, nz, curved


@kernel
def _box(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    bx: float,
    by: float,
    bz: float,
    r: float,
) -> Answer:
    reach = sqrt(bx * bx + by * by + bz * bz) + r
    best, px, py, pz, nx, ny, nz, curved = patch_of_box(fx, fy, fz, mx, my, mz, bx, by, bz, r)
    if best <= _PATCH_TOLERANCE * reach:
        return _on_box(fx, fy, fz, mx, my, mz, r, px, py, pz, nx, ny, nz, curved)
    size = (bx, by, bz, r)
    if r == 0.0:
        answer = enter(_BOX, size, reach, fx, fy, fz, mx, my, mz)
        return (SHARP, *answer[1:]) if answer[0] == OK else answer
    answer = nearest_to_line(_BOX, size, reach, fx, fy, fz, mx, my, mz)
    if invariant(fx, fy, fz, mx, my, mz) != 0.0:
        return NOT_CONVERGED, *answer[1:]
    return answer


@kernel
def solve_box(
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
    """Contact centroid on a box about the origin plus a ball: the `BOX` of
    `contactsense.robots.surface.convex_primitives`.

    Args:
        fx, fy, fz, mx, my, mz: Wrench on the body.
        bx, by, bz: Half edge lengths of the box (without the ball), may be zero.
        rounding: Radius of the ball. May be zero: the status is `SHARP` for a wrench that enters no face,
            where its axis enters.

    Returns:
        See `contactsense.solvers.solution`.
    """
    size = max(bx, by, bz) + rounding
    ff = fx * fx + fy * fy + fz * fz
    mm = mx * mx + my * my + mz * mz
    round_enough = rounding == 0.0 or rounding * rounding * ff > SMALL
    if ff > SMALL and round_enough and size * size * ff < LARGE and mm < LARGE:
        return _box(fx, fy, fz, mx, my, mz, bx, by, bz, rounding)
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    e, g, k = unit_exponents(fx, fy, fz, mx, my, mz, size)
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, k)
    bx, by, bz, rounding = ldexp(bx, -k), ldexp(by, -k), ldexp(bz, -k), ldexp(rounding, -k)
    return rescaled(_box(fx, fy, fz, mx, my, mz, bx, by, bz, rounding), e, g, k)
