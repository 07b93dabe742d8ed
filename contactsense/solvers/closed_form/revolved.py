"""Bodies of revolution with rounded rims: disc, ball, capsule, cylinder and truncated cone with flat
caps.

Exactly one patch contains the contact: two caps (planes) and the side (cylinder or cone) in closed form,
and two rims: balls in closed form if a cap has no radius, else parts of a torus. If rounding errors place
the contact outside every patch, the nearest is used.
"""

from math import atan2, pi, sqrt
from typing import NamedTuple

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.surface.convex_primitives import REVOLVED
from contactsense.robots.vectors import dot
from contactsense.solvers.closed_form.cylinder import directions, height, lateral_frame, on_lateral
from contactsense.solvers.closed_form.ellipsoid import ball
from contactsense.solvers.closed_form.nearest_point import nearest_to_line
from contactsense.solvers.closed_form.torus_rim import (
    Place,
    Rim,
    bisect_rim,
    refine_rim,
    search_rim,
    start_rim,
)
from contactsense.solvers.solution import (
    FAR,
    NOT_CONVERGED,
    OK,
    PATCH_TOLERANCE,
    Answer,
    make_answer,
    no_contact,
    torsion,
    with_status,
)
from contactsense.solvers.units import LARGE, SMALL, from_units, in_units, length_to_units
from contactsense.solvers.wrench import Wrench, about_height, invariant


class Body(NamedTuple):
    """A truncated cone about z plus a ball."""

    half: float
    """Half the height of the cone, without the ball."""
    lower: float
    """Radius of the cone at -half."""
    upper: float
    """Radius of the cone at half."""
    r: float
    """Radius of the ball."""
    reach: float
    """Size of the body."""
    cos_beta: float
    """Cosine of the angle between side and axis."""
    sin_beta: float
    """Its sine; above zero if the body tapers off upwards."""


class Side(NamedTuple):
    """A contact on the side."""

    outside: float
    """How far outside of the side (below zero: inside)."""
    ex: float
    """Radial direction, x."""
    ey: float
    """Radial direction, y."""
    z: float
    """Height."""
    rho: float
    """Distance from the axis."""


class End(NamedTuple):
    """A contact on the rim at one end, or on the ball there."""

    outside: float
    """How far outside of the patch between side and cap (below zero: inside)."""
    at: float
    """Height of the rim's circle."""
    ring: float
    """Radius of that circle; 0: a ball."""
    place: Place
    """Where on the rim."""


@kernel
def _on_cap(wrench: Wrench, x: float, y: float, top: float) -> Answer:
    c, n = (x, y, top), (0.0, 0.0, 1.0 if wrench.force[2] < 0.0 else -1.0)
    return make_answer(OK, wrench, c, n, torsion(wrench, c, n), 0.0, 0.0)


@kernel
def _on_end(wrench: Wrench, r: float, end: End) -> Answer:
    ex, ey, ca, sa = end.place
    n = (ca * ex, ca * ey, sa)
    rho = end.ring + r * ca
    c = (rho * ex, rho * ey, end.at + r * sa)
    bend = 1.0 / r
    around = ca / rho if end.ring > 0.0 else bend
    return make_answer(OK, wrench, c, n, torsion(wrench, c, n), bend + around, bend * around)


@kernel
def _side(wrench: Wrench, body: Body) -> tuple[Side, float]:
    """Contact on the side, and tan(beta)."""
    half, lower, upper, r, _, cos_beta, sin_beta = body
    best = Side(FAR, 0.0, 0.0, 0.0, 0.0)
    if not (cos_beta > 0.0 and half > 0.0):
        return best, 0.0
    taper = sin_beta / cos_beta
    radius = 0.5 * (lower + upper) + r / cos_beta
    low, high = r * sin_beta - half, r * sin_beta + half
    apex = (0.5 * (lower + upper) * cos_beta + r) / sin_beta if sin_beta != 0.0 else 0.0
    local, base, below = lateral_frame(wrench, radius, taper, apex)
    disc, a, b, u, v = directions(local, base, taper)
    if disc > 0.0:
        # On a cylinder the force pushes on the first of the two directions only; on a cone on either or both.
        for sign in (-1.0, 1.0):
            ax, ay = a + sign * u, b + sign * v
            at, push = height(local, ax, ay, base, taper)
            outside = max(below + at - high, low - below - at)
            if push < 0.0 and outside < best.outside:
                best = Side(outside, ax, ay, below + at, base - taper * at)
            if taper == 0.0:
                break
    return best, taper


@kernel
def _circle(body: Body, top: bool) -> tuple[float, float, float]:
    """Height and radius of the circle of the upper or lower rim, and the sign of its side."""
    return (body.half, body.upper, 1.0) if top else (-body.half, body.lower, -1.0)


@kernel
def _end(wrench: Wrench, body: Body, top: bool, ca: float, sa: float) -> End:
    """Contact on the upper or lower rim, or on the ball there, started at the elevation (ca, sa)."""
    at, ring, sign = _circle(body, top)
    if ring == 0.0:
        status, n, _ = ball(wrench, at, body.r)
        across = sqrt(n[0] * n[0] + n[1] * n[1])
        ex, ey = (n[0] / across, n[1] / across) if across > 0.0 else (1.0, 0.0)
        found, place = status == OK, Place(ex, ey, across, n[2])
    else:
        local, rim = about_height(wrench, at), Rim(ring, body.r)
        found, place = start_rim(local, rim, ca, sa)
        if found:
            found, place, _ = refine_rim(local, rim, place)
    beyond = max(sign * (body.sin_beta * place.ca - place.sa * body.cos_beta), -place.ca)
    return End(body.reach * beyond if found else FAR, at, ring, place)


@kernel
def _bisected(wrench: Wrench, body: Body) -> tuple[bool, End]:
    """The contact on either rim, by bisection, and whether it is found."""
    seam = atan2(body.sin_beta, body.cos_beta)
    for top in (True, False):
        at, ring, sign = _circle(body, top)
        if ring > 0.0:
            found, place = bisect_rim(about_height(wrench, at), Rim(ring, body.r), seam, sign * 0.5 * pi)
            if found:
                return True, End(0.0, at, ring, place)
    return False, End(FAR, 0.0, 0.0, Place(1.0, 0.0, 1.0, 0.0))


@kernel
def _global_search(wrench: Wrench, body: Body) -> Answer:
    """Search both rims from starts all around; if that fails too, the wrench misses."""
    for top in (True, False):
        at, ring, sign = _circle(body, top)
        if ring > 0.0:
            found, place = search_rim(about_height(wrench, at), Rim(ring, body.r))
            beyond = max(sign * (body.sin_beta * place.ca - place.sa * body.cos_beta), -place.ca)
            if found and beyond < PATCH_TOLERANCE:
                return _on_end(wrench, body.r, End(0.0, at, ring, place))
    size = (body.half, body.lower, body.upper, body.r)
    answer = nearest_to_line(REVOLVED, size, body.reach, wrench)
    return answer if invariant(wrench) == 0.0 else with_status(answer, NOT_CONVERGED)


@kernel
def _revolved(wrench: Wrench, half: float, lower: float, upper: float, r: float) -> Answer:
    if half == 0.0:
        # The larger disc is the body.
        lower = upper = max(lower, upper)
    reach = half + max(lower, upper) + r
    length = sqrt(4.0 * half * half + (lower - upper) * (lower - upper))
    cos_beta, sin_beta = (2.0 * half / length, (lower - upper) / length) if length > 0.0 else (1.0, 0.0)
    body = Body(half, lower, upper, r, reach, cos_beta, sin_beta)
    f, m = wrench
    # The cap that the force pushes on.
    up = f[2] < 0.0
    top, ring = (half + r, upper) if up else (-half - r, lower)
    cap_x = cap_y = 0.0
    over_cap = FAR
    if f[2] != 0.0 and ring > 0.0:
        cap_x, cap_y = (top * f[0] - m[1]) / f[2], (top * f[1] + m[0]) / f[2]
        over_cap = sqrt(cap_x * cap_x + cap_y * cap_y) - ring
        if over_cap <= 0.0:
            return _on_cap(wrench, cap_x, cap_y, top)
    side, taper = _side(wrench, body)
    if side.outside <= 0.0:
        return on_lateral(OK, wrench, side.ex, side.ey, side.z, side.rho, taper)
    best, end = _nearer_end(wrench, body, side, up, over_cap)
    if best > 0.0:
        # The iteration failed, or rounding errors put the contact beside a seam.
        found, trial = _bisected(wrench, body)
        if found:
            return _on_end(wrench, r, trial)
    if best > PATCH_TOLERANCE * reach:
        return _global_search(wrench, body)
    if end.outside < FAR:
        return _on_end(wrench, r, end)
    if over_cap <= side.outside:
        return _on_cap(wrench, cap_x, cap_y, top)
    return on_lateral(OK, wrench, side.ex, side.ey, side.z, side.rho, taper)


@kernel
def _nearer_end(wrench: Wrench, body: Body, side: Side, up: bool, over_cap: float) -> tuple[float, End]:
    """Search the rounded ends beside cap and side.

    Args:
        wrench: Wrench on the body.
        body: The body.
        side: The contact on the side.
        up: Whether the upper cap is the one that the force pushes on.
        over_cap: How far beyond the rim the contact on that cap is.

    Returns:
        How far the contact is outside the patch that is nearest to it: cap, side or an end. And the contact
        on that end; `FAR` outside if no end is nearest.
    """
    r, reach, cos_beta, sin_beta = body.r, body.reach, body.cos_beta, body.sin_beta
    best = min(over_cap, side.outside)
    # The ends: first the one that the side, or else the cap, points at.
    first = side.z > r * sin_beta if side.outside < FAR else up
    end = End(FAR, 0.0, 0.0, Place(0.0, 0.0, 0.0, 0.0))
    for turn in range(2):
        at_top = first == (turn == 0)
        sign = 1.0 if at_top else -1.0
        # Start between side and cap, in proportion to their violations.
        share = 0.5
        if at_top == up and over_cap < FAR:
            beside = min(side.outside, reach)
            share = beside / (beside + over_cap)
        c, s = (1.0 - share) * cos_beta, (1.0 - share) * sin_beta + sign * share
        size = sqrt(c * c + s * s)
        c, s = (c / size, s / size) if size > 0.0 else (1.0, 0.0)
        trial = _end(wrench, body, at_top, c, s)
        if trial.outside < best:
            best, end = trial.outside, trial
            if best <= 0.0:
                break
    if best > 0.0 and min(over_cap, side.outside) < reach:
        # The iteration on the rim failed near cap or side: restart from their seam.
        at_cap = over_cap <= side.outside
        at_top = up if at_cap else first
        sign = 1.0 if at_top else -1.0
        c, s = (0.0, sign) if at_cap else (cos_beta, sin_beta)
        trial = _end(wrench, body, at_top, c, s)
        if trial.outside < best:
            best, end = trial.outside, trial
    return best, end


@kernel
def solve_revolved(wrench: Wrench, half: float, lower: float, upper: float, rounding: float) -> Answer:
    """Contact centroid on a truncated cone about z plus a ball: the `REVOLVED` of
    `contactsense.robots.surface.convex_primitives`.

    Args:
        wrench: Wrench on the body.
        half: Half the height of the cone (without the ball), may be zero.
        lower, upper: Radii of the cone at -half and half, may be zero.
        rounding: Radius of the ball.

    Returns:
        See `contactsense.solvers.solution`.
    """
    f, m = wrench
    size = half + max(lower, upper) + rounding
    ff = dot(f, f)
    if rounding * rounding * ff > SMALL and size * size * ff < LARGE and dot(m, m) < LARGE:
        return _revolved(wrench, half, lower, upper, rounding)
    status, local, units = in_units(wrench, size)
    if status != OK:
        return no_contact(status)
    half, rounding = length_to_units(half, units), length_to_units(rounding, units)
    lower, upper = length_to_units(lower, units), length_to_units(upper, units)
    return from_units(_revolved(local, half, lower, upper, rounding), units)
