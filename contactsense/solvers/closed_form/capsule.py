"""Capsule and tapered capsule: two spheres and the cone (or cylinder) tangent to both, each in closed
form.

The normals of the patches agree where they meet, so exactly one contains the contact (paper, section 7).
If rounding errors place the contact outside both, the nearer patch is used, so there is no gap.
"""

from math import sqrt
from typing import NamedTuple

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import dot
from contactsense.solvers.closed_form.cylinder import directions, height, lateral_frame, on_lateral
from contactsense.solvers.closed_form.ellipsoid import ball, on_ball
from contactsense.solvers.closed_form.nearest_point import TAPERED, nearest_to_line
from contactsense.solvers.solution import FAR, OK, PATCH_TOLERANCE, Answer, no_contact
from contactsense.solvers.units import LARGE, SMALL, from_units, in_units, length_to_units
from contactsense.solvers.wrench import Wrench, sum_error


class _Capsule(NamedTuple):
    """A tapered capsule."""

    half: float
    """Half the distance of the centres of its balls."""
    radius_a: float
    """Of the lower ball."""
    radius_b: float
    """Of the upper ball."""
    cos_beta: float
    """Cosine of the angle between side and axis."""
    sin_beta: float
    """Its sine, positive if the lower ball is larger."""
    taper: float
    """Its tangent."""


class _Side(NamedTuple):
    """The contact on the cone or cylinder of the side."""

    outside: float
    """How far it is beyond the ends of the side; `FAR`: there is none."""
    upper: bool
    """Whether it is on the upper half."""
    ex: float
    """Direction from the axis, x."""
    ey: float
    """Direction from the axis, y."""
    z: float
    """Height."""
    rho: float
    """Distance from the axis."""


@kernel
def _tapered_capsule(wrench: Wrench, half: float, radius_a: float, radius_b: float) -> Answer:
    # 1 - sin_beta as the one exact difference that a steep side needs.
    length, drop = 2.0 * half, radius_a - radius_b
    error = sum_error(radius_a, -radius_b, drop)
    less, more = (length - drop) - error, (length + drop) + error
    cos_beta, taper = sqrt(less * more) / length, drop / sqrt(less * more)
    body = _Capsule(half, radius_a, radius_b, cos_beta, drop / length, taper)
    size = half + max(radius_a, radius_b)
    side = _on_side(wrench, body)
    best, patch, n, xi = side.outside, 1, (0.0, 0.0, 0.0), 0.0
    for turn in range(2):
        if best <= 0.0:
            break
        top = side.upper == (turn == 0)
        at, r = (half, radius_b) if top else (-half, radius_a)
        status, s, k = ball(wrench, at, r)
        outside = r * ((body.sin_beta - s[2]) if top else (s[2] - body.sin_beta))
        if status == OK and outside < best:
            best, patch = outside, 3 if top else 2
            n, xi = s, k
    if best > PATCH_TOLERANCE * size:
        return nearest_to_line(TAPERED, (half, radius_a, radius_b, 0.0), size, wrench)
    if patch == 1:
        return on_lateral(OK, wrench, side.ex, side.ey, side.z, side.rho, taper)
    at, r = (half, radius_b) if patch == 3 else (-half, radius_a)
    return on_ball(OK, wrench, at, r, n, xi)


@kernel
def _on_side(wrench: Wrench, body: _Capsule) -> _Side:
    """The contact on the side that is nearest to it, or on it."""
    half, radius_a, radius_b, cos_beta, sin_beta, taper = body
    mean = 0.5 * (radius_a + radius_b)
    apex = mean / sin_beta if sin_beta != 0.0 else 0.0
    local, base, below = lateral_frame(wrench, mean / cos_beta, taper, apex)
    found = _Side(FAR, True, 0.0, 0.0, 0.0, 0.0)
    disc, a, b, u, v = directions(local, base, taper)
    if not disc > 0.0:
        return found
    for sign in (-1.0, 1.0):
        ax, ay = a + sign * u, b + sign * v
        at, push = height(local, ax, ay, base, taper)
        if push < 0.0:
            # Along the side, from the circle about the middle; a steep side is measured by its radius.
            if below == 0.0:
                along = (at - mean * sin_beta) / cos_beta
            else:
                along = (mean * cos_beta + taper * at) / sin_beta
            outside = abs(along) - half * cos_beta
            if outside < found.outside:
                found = _Side(outside, along > 0.0, ax, ay, at + below, base - taper * at)
        if found.outside <= 0.0 or taper == 0.0:
            break
    return found


@kernel
def solve_tapered_capsule(wrench: Wrench, half: float, radius_a: float, radius_b: float) -> Answer:
    """Contact centroid on the convex hull of two balls on z.

    Args:
        wrench: Wrench on the body.
        half: Half the distance of their centres, (0, 0, -half) and (0, 0, half).
        radius_a, radius_b: Of the lower and the upper ball; they differ by less than 2 half.

    Returns:
        See `contactsense.solvers.solution`.
    """
    f, m = wrench
    size = max(radius_a, radius_b)
    ff = dot(f, f)
    if SMALL < size * size * ff < LARGE and dot(m, m) < LARGE and half * half * ff < LARGE:
        return _tapered_capsule(wrench, half, radius_a, radius_b)
    status, local, units = in_units(wrench, half + size)
    if status != OK:
        return no_contact(status)
    half = length_to_units(half, units)
    radius_a, radius_b = length_to_units(radius_a, units), length_to_units(radius_b, units)
    return from_units(_tapered_capsule(local, half, radius_a, radius_b), units)
