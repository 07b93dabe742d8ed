"""Rounded box: six faces (planes), twelve edges (cylinders) and eight corners (balls), all in closed form.

Exactly one patch holds the contact. Most are ruled out by one comparison: a face must be pushed at, an edge
must not be missed by the force's line. What rounding leaves outside of every patch goes to the nearest.
"""

from math import ldexp, sqrt

from contactsense.solvers.answer import (
    LARGE,
    NOT_CONVERGED,
    OK,
    SHARP,
    SMALL,
    Answer,
    finish,
    nothing,
    rescaled,
    scaled,
    torsion,
    unit_exponents,
    unusable,
)
from contactsense.solvers.cylinder import directions
from contactsense.solvers.ellipsoid import unit_sphere
from contactsense.solvers.nearest import enter, nearest_to_line
from contactsense.solvers.typed import kernel

_SEAM = 1e-9
"""How far outside of its patch, relative to the size of the body, a contact may lie by rounding."""

_BOX = 2
"""Number of this kind in `robots.surface`."""

_PURE = 1e-12
"""Torsion per force and moment below which a wrench that enters nowhere is a force that passes by."""

_FAR = 1e300

Place = tuple[float, float, float, float, float, float, float]
"""How far outside of its patch (below zero: inside), point of the core, outward normal."""


@kernel
def _face(
    fx: float, fy: float, fz: float, mx: float, my: float, bx: float, by: float, bz: float, r: float
) -> Place:
    """Contact on the face across z that is pushed at."""
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
    """Contact on the least wrong of the four edges along z."""
    least = _FAR
    x = y = z = nx = ny = 0.0
    limit = r * r * (fx * fx + fy * fy)
    # First the edge that the force comes from.
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
                if outside < least:
                    least, x, y, z, nx, ny = outside, px, py, at, ex, ey
                    if least <= 0.0:
                        break
    return least, x, y, z, nx, ny, 0.0


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
    """Contact on the least wrong of the eight corners."""
    least = _FAR
    x = y = z = nx = ny = nz = 0.0
    ux, uy, uz = r * fx, r * fy, r * fz
    uu = ux * ux + uy * uy + uz * uz
    likely = (1 if fx > 0.0 else 0) + (2 if fy > 0.0 else 0) + (4 if fz > 0.0 else 0)
    for turn in range(8):
        k = likely ^ turn
        sx, sy, sz = 1.0 - 2.0 * (k & 1), 1.0 - (k & 2), 1.0 - 0.5 * (k & 4)
        px, py, pz = sx * bx, sy * by, sz * bz
        lx = mx - (py * fz - pz * fy)
        ly = my - (pz * fx - px * fz)
        lz = mz - (px * fy - py * fx)
        status, ex, ey, ez, _ = unit_sphere(ux, uy, uz, lx, ly, lz, uu, lx * lx + ly * ly + lz * lz)
        outside = -reach * min(sx * ex, sy * ey, sz * ez)
        if status == OK and outside < least:
            least, x, y, z, nx, ny, nz = outside, px, py, pz, ex, ey, ez
            if least <= 0.0:
                break
    return least, x, y, z, nx, ny, nz


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
    bends: int,
) -> Answer:
    """The answer at r n outside of the core's point p; `bends` principal curvatures are 1 / r."""
    cx, cy, cz = px + r * nx, py + r * ny, pz + r * nz
    xi = torsion(fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz)
    bend = 1.0 / r if bends > 0 else 0.0
    det = bend * bend if bends == 2 else 0.0
    return finish(OK, fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz, xi, bends * bend, det)


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
    """The patch that a wrench enters: a `Place`, and how many of its principal curvatures are 1 / r."""
    reach = sqrt(bx * bx + by * by + bz * bz) + r
    best = _FAR
    px = py = pz = nx = ny = nz = 0.0
    bends = 0
    # The axes in turn play z.
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
                return best, px, py, pz, nx, ny, nz, bends
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
                bends = 1
                if best <= 0.0:
                    return best, px, py, pz, nx, ny, nz, bends
        d, x, y, z, ex, ey, ez = _corners(fx, fy, fz, mx, my, mz, bx, by, bz, r, reach)
        if d < best:
            best, px, py, pz, nx, ny, nz = d, x, y, z, ex, ey, ez
            bends = 2
    return best, px, py, pz, nx, ny, nz, bends


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
    best, px, py, pz, nx, ny, nz, bends = patch_of_box(fx, fy, fz, mx, my, mz, bx, by, bz, r)
    if best <= _SEAM * reach:
        return _on_box(fx, fy, fz, mx, my, mz, r, px, py, pz, nx, ny, nz, bends)
    size = (bx, by, bz, r)
    if r == 0.0:
        answer = enter(_BOX, size, reach, fx, fy, fz, mx, my, mz)
        return (SHARP, *answer[1:]) if answer[0] == OK else answer
    answer = nearest_to_line(_BOX, size, reach, fx, fy, fz, mx, my, mz)
    t = fx * mx + fy * my + fz * mz
    ff = fx * fx + fy * fy + fz * fz
    mm = mx * mx + my * my + mz * mz
    if t * t > _PURE * _PURE * ff * (mm + reach * reach * ff):
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
    """Contact centroid on a box about the origin plus a ball: the `BOX` of `robots.surface`.

    Args:
        fx, fy, fz, mx, my, mz: Wrench on the body.
        bx, by, bz: Half edge lengths of the box (without the ball), may be zero.
        rounding: Radius of the ball. May be zero: a wrench that enters no face is then answered with `SHARP`,
            where its axis enters.

    Returns:
        See `contactsense.solvers.answer`.
    """
    size = max(bx, by, bz) + rounding
    ff = fx * fx + fy * fy + fz * fz
    mm = mx * mx + my * my + mz * mz
    round_enough = rounding == 0.0 or rounding * rounding * ff > SMALL
    if ff > SMALL and round_enough and size * size * ff < LARGE and mm < LARGE:
        return _box(fx, fy, fz, mx, my, mz, bx, by, bz, rounding)
    status = unusable(fx, fy, fz, mx, my, mz)
    if status != OK:
        return nothing(status)
    e, g, k = unit_exponents(fx, fy, fz, mx, my, mz, size)
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, k)
    bx, by, bz, rounding = ldexp(bx, -k), ldexp(by, -k), ldexp(bz, -k), ldexp(rounding, -k)
    return rescaled(_box(fx, fy, fz, mx, my, mz, bx, by, bz, rounding), e, g, k)
