"""Bodies of revolution with rounded rims: disc, ball, capsule, cylinder and truncated cone with flat
caps.

Exactly one patch contains the contact: two caps (planes) and the side (cylinder or cone) in closed form,
and two rims: balls in closed form if a cap has no radius, else parts of a torus. If rounding errors place
the contact outside every patch, the nearest is used.
"""

from math import atan2, ldexp, pi, sqrt

from contactsense.solvers.capsule import ball
from contactsense.solvers.cylinder import directions, height, lateral_frame, on_lateral
from contactsense.solvers.nearest_point import nearest_to_line
from contactsense.solvers.solution import (
    LARGE,
    NOT_CONVERGED,
    OK,
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
from contactsense.solvers.torus_rim import bisect_rim, refine_rim, search_rim, start_rim
from contactsense.solvers.typed_kernel import kernel

_PATCH_TOLERANCE = 1e-9
"""How far outside of its patch, relative to the size of the body, a contact may lie by rounding."""

_REVOLVED = 0
"""Number of this kind in `contactsense.robots.surface.convex_primitives`."""

_FAR = 1e300


@kernel
def _on_cap(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, cx: float, cy: float, top: float
) -> Answer:
    nz = 1.0 if fz < 0.0 else -1.0
    xi = torsion(fx, fy, fz, mx, my, mz, cx, cy, top, 0.0, 0.0, nz)
    return make_answer(OK, fx, fy, fz, mx, my, mz, cx, cy, top, 0.0, 0.0, nz, xi, 0.0, 0.0)


@kernel
def _on_end(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    at: float,
    ring: float,
    r: float,
    ex: float,
    ey: float,
    ca: float,
    sa: float,
) -> Answer:
    """The answer on the ball of radius r about the circle at height `at`, or about its centre if `ring` is
    0."""
    nx, ny, nz = ca * ex, ca * ey, sa
    rho = ring + r * ca
    cx, cy, cz = rho * ex, rho * ey, at + r * sa
    xi = torsion(fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz)
    bend = 1.0 / r
    around = ca / rho if ring > 0.0 else bend
    return make_answer(OK, fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz, xi, bend + around, bend * around)


@kernel
def _side(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    radius: float,
    taper: float,
    apex: float,
    low: float,
    high: float,
) -> tuple[float, float, float, float, float]:
    """Contact on the side, between the heights `low` and `high`: radial direction, height, distance from the
    axis, and how far outside."""
    ex = ey = z = rho = 0.0
    lowest = _FAR
    lx, ly, base, below = lateral_frame(fx, fy, mx, my, radius, taper, apex)
    disc, a, b, u, v = directions(fx, fy, lx, ly, mz, base, taper)
    if disc > 0.0:
        # On a cylinder the force pushes on the first of the two directions only; on a cone on either or both.
        for sign in (-1.0, 1.0):
            ax, ay = a + sign * u, b + sign * v
            at, push = height(fx, fy, fz, lx, ly, ax, ay, base, taper)
            outside = max(below + at - high, low - below - at)
            if push < 0.0 and outside < lowest:
                ex, ey, z, rho, lowest = ax, ay, below + at, base - taper * at, outside
            if taper == 0.0:
                break
    return ex, ey, z, rho, lowest


@kernel
def _end(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    at: float,
    ring: float,
    r: float,
    ca: float,
    sa: float,
) -> tuple[bool, float, float, float, float]:
    """Contact on the rim about height `at`, or on the ball there, started at the elevation (ca, sa)."""
    lx, ly = mx + at * fy, my - at * fx
    if ring == 0.0:
        status, nx, ny, nz, _ = ball(fx, fy, fz, mx, my, mz, at, r)
        across = sqrt(nx * nx + ny * ny)
        ex, ey = (nx / across, ny / across) if across > 0.0 else (1.0, 0.0)
        return status == OK, ex, ey, across, nz
    found, ex, ey, ca, sa = start_rim(fx, fy, fz, lx, ly, mz, ring, r, ca, sa)
    if found:
        found, ex, ey, ca, sa, _ = refine_rim(fx, fy, fz, lx, ly, mz, ring, r, ex, ey, ca, sa)
    return found, ex, ey, ca, sa


@kernel
def _bisected(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    half: float,
    lower: float,
    upper: float,
    r: float,
    cos_beta: float,
    sin_beta: float,
) -> tuple[bool, float, float, float, float, float, float]:
    """The contact on either rim, by bisection: whether it is found, height and radius of the circle, radial
    direction, cosine and sine of the elevation."""
    seam = atan2(sin_beta, cos_beta)
    for side in (1.0, -1.0):
        at, ring = side * half, upper if side > 0.0 else lower
        if ring > 0.0:
            lx, ly = mx + at * fy, my - at * fx
            found, ex, ey, ca, sa = bisect_rim(fx, fy, fz, lx, ly, mz, ring, r, seam, side * 0.5 * pi)
            if found:
                return True, at, ring, ex, ey, ca, sa
    return False, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0


@kernel
def _global_search(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    half: float,
    lower: float,
    upper: float,
    r: float,
    cos_beta: float,
    sin_beta: float,
) -> Answer:
    """Search both rims from starts all around; if that fails too, the wrench misses."""
    reach = half + max(lower, upper) + r
    for side in (1.0, -1.0):
        at, ring = side * half, upper if side > 0.0 else lower
        if ring > 0.0:
            found, ex, ey, ca, sa = search_rim(fx, fy, fz, mx + at * fy, my - at * fx, mz, ring, r)
            if found and max(side * (sin_beta * ca - sa * cos_beta), -ca) < _PATCH_TOLERANCE:
                return _on_end(fx, fy, fz, mx, my, mz, at, ring, r, ex, ey, ca, sa)
    size = (half, lower, upper, r)
    answer = nearest_to_line(_REVOLVED, size, reach, fx, fy, fz, mx, my, mz)
    if invariant(fx, fy, fz, mx, my, mz) != 0.0:
        return NOT_CONVERGED, *answer[1:]
    return answer


@kernel
def _revolved(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    half: float,
    lower: float,
    upper: float,
    r: float,
) -> Answer:
    reach = half + max(lower, upper) + r
    length = sqrt(4.0 * half * half + (lower - upper) * (lower - upper))
    cos_beta, sin_beta = (2.0 * half / length, (lower - upper) / length) if length > 0.0 else (1.0, 0.0)
    # The cap that the force pushes on.
    up = fz < 0.0
    top, ring = (half + r, upper) if up else (-half - r, lower)
    cap_x = cap_y = 0.0
    over_cap = _FAR
    if fz != 0.0 and ring > 0.0:
        cap_x, cap_y = (top * fx - my) / fz, (top * fy + mx) / fz
        over_cap = sqrt(cap_x * cap_x + cap_y * cap_y) - ring
        if over_cap <= 0.0:
            return _on_cap(fx, fy, fz, mx, my, mz, cap_x, cap_y, top)
    # The side.
    side_x = side_y = side_z = side_rho = taper = 0.0
    over_side = _FAR
    if cos_beta > 0.0 and half > 0.0:
        taper = sin_beta / cos_beta
        radius = 0.5 * (lower + upper) + r / cos_beta
        low, high = r * sin_beta - half, r * sin_beta + half
        apex = (0.5 * (lower + upper) * cos_beta + r) / sin_beta if sin_beta != 0.0 else 0.0
        side_x, side_y, side_z, side_rho, over_side = _side(
            fx, fy, fz, mx, my, mz, radius, taper, apex, low, high
        )
        if over_side <= 0.0:
            return on_lateral(OK, fx, fy, fz, mx, my, mz, side_x, side_y, side_z, side_rho, taper)
    best = min(over_cap, over_side)
    # The ends: first the one that the side, or else the cap, points at.
    first = side_z > r * sin_beta if over_side < _FAR else up
    at = ring = ex = ey = ca = sa = 0.0
    on_end = False
    for turn in range(2):
        at_top = first == (turn == 0)
        a_at, a_ring, sign = (half, upper, 1.0) if at_top else (-half, lower, -1.0)
        # Start between side and cap, in proportion to their violations.
        share = 0.5
        if at_top == up and over_cap < _FAR:
            beside = min(over_side, reach)
            share = beside / (beside + over_cap)
        c, s = (1.0 - share) * cos_beta, (1.0 - share) * sin_beta + sign * share
        size = sqrt(c * c + s * s)
        c, s = (c / size, s / size) if size > 0.0 else (1.0, 0.0)
        found, ax, ay, ac, as_ = _end(fx, fy, fz, mx, my, mz, a_at, a_ring, r, c, s)
        outside = reach * max(sign * (sin_beta * ac - as_ * cos_beta), -ac)
        if found and outside < best:
            best, on_end = outside, True
            at, ring, ex, ey, ca, sa = a_at, a_ring, ax, ay, ac, as_
            if best <= 0.0:
                break
    if best > 0.0 and min(over_cap, over_side) < reach:
        # The iteration on the rim failed near cap or side: restart from their seam.
        at_cap = over_cap <= over_side
        at_top = up if at_cap else first
        a_at, a_ring, sign = (half, upper, 1.0) if at_top else (-half, lower, -1.0)
        c, s = (0.0, sign) if at_cap else (cos_beta, sin_beta)
        found, ax, ay, ac, as_ = _end(fx, fy, fz, mx, my, mz, a_at, a_ring, r, c, s)
        outside = reach * max(sign * (sin_beta * ac - as_ * cos_beta), -ac)
        if found and outside < best:
            best, on_end = outside, True
            at, ring, ex, ey, ca, sa = a_at, a_ring, ax, ay, ac, as_
    if best > 0.0:
        # The iteration failed, or rounding errors put the contact beside a seam.
        found, a_at, a_ring, ax, ay, ac, as_ = _bisected(
            fx, fy, fz, mx, my, mz, half, lower, upper, r, cos_beta, sin_beta
        )
        if found:
            return _on_end(fx, fy, fz, mx, my, mz, a_at, a_ring, r, ax, ay, ac, as_)
    if best > _PATCH_TOLERANCE * reach:
        return _global_search(fx, fy, fz, mx, my, mz, half, lower, upper, r, cos_beta, sin_beta)
    if on_end:
        return _on_end(fx, fy, fz, mx, my, mz, at, ring, r, ex, ey, ca, sa)
    if over_cap <= over_side:
        return _on_cap(fx, fy, fz, mx, my, mz, cap_x, cap_y, top)
    return on_lateral(OK, fx, fy, fz, mx, my, mz, side_x, side_y, side_z, side_rho, taper)


@kernel
def solve_revolved(
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
    """Contact centroid on a truncated cone about z plus a ball: the `REVOLVED` of
    `contactsense.robots.surface.convex_primitives`.

    Args:
        fx, fy, fz, mx, my, mz: Wrench on the body.
        half: Half the height of the cone (without the ball), may be zero.
        lower, upper: Radii of the cone at -half and half, may be zero.
        rounding: Radius of the ball.

    Returns:
        See `contactsense.solvers.solution`.
    """
    size = half + max(lower, upper) + rounding
    ff = fx * fx + fy * fy + fz * fz
    mm = mx * mx + my * my + mz * mz
    if rounding * rounding * ff > SMALL and size * size * ff < LARGE and mm < LARGE:
        return _revolved(fx, fy, fz, mx, my, mz, half, lower, upper, rounding)
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    e, g, k = unit_exponents(fx, fy, fz, mx, my, mz, size)
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, k)
    half, lower, upper, rounding = ldexp(half, -k), ldexp(lower, -k), ldexp(upper, -k), ldexp(rounding, -k)
    return rescaled(_revolved(fx, fy, fz, mx, my, mz, half, lower, upper, rounding), e, g, k)
