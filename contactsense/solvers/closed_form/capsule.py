"""Capsule and tapered capsule: two spheres and the cone (or cylinder) tangent to both, each in closed
form.

The normals of the patches agree where they meet, so exactly one contains the contact (paper, section 7).
If rounding errors place the contact outside both, the nearer patch is used, so there is no gap.
"""

from math import sqrt

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import dot
from contactsense.solvers.closed_form.cylinder import directions, height, lateral_frame, on_lateral
from contactsense.solvers.closed_form.ellipsoid import ball, on_ball
from contactsense.solvers.closed_form.nearest_point import TAPERED, nearest_to_line
from contactsense.solvers.solution import FAR, OK, PATCH_TOLERANCE, Answer, no_contact
from contactsense.solvers.units import LARGE, SMALL, from_units, in_units, length_to_units
from contactsense.solvers.wrench import Wrench, sum_error


@kernel
def _tapered_capsule(wrench: Wrench, half: float, radius_a: float, radius_b: float) -> Answer:
    # 1 - sin_beta as the one exact difference that a steep side needs.
    length, drop = 2.0 * half, radius_a - radius_b
    error = sum_error(radius_a, -radius_b, drop)
    less, more = (length - drop) - error, (length + drop) + error
    sin_beta, cos_beta = drop / length, sqrt(less * more) / length
    taper = drop / sqrt(less * more)
    mean = 0.5 * (radius_a + radius_b)
    radius = mean / cos_beta
    apex = mean / sin_beta if sin_beta != 0.0 else 0.0
    local, base, below = lateral_frame(wrench, radius, taper, apex)
    best, patch, high = FAR, 0, True
    ex = ey = z = rho = xi = 0.0
    n = (0.0, 0.0, 0.0)
    disc, a, b, u, v = directions(local, base, taper)
    if disc > 0.0:
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
                if outside < best:
                    best, patch = outside, 1
                    ex, ey, z, rho = ax, ay, at + below, base - taper * at
                    high = along > 0.0
            if best <= 0.0 or taper == 0.0:
                break
    if best > 0.0:
        upper = high
        for turn in range(2):
            top = upper == (turn == 0)
            at, r = (half, radius_b) if top else (-half, radius_a)
            status, s, k = ball(wrench, at, r)
            outside = r * ((sin_beta - s[2]) if top else (s[2] - sin_beta))
            if status == OK and outside < best:
                best, patch = outside, 3 if top else 2
                n, xi = s, k
            if best <= 0.0:
                break
    if best > PATCH_TOLERANCE * (half + max(radius_a, radius_b)):
        size = (half, radius_a, radius_b, 0.0)
        return nearest_to_line(TAPERED, size, half + max(radius_a, radius_b), wrench)
    if patch == 1:
        return on_lateral(OK, wrench, ex, ey, z, rho, taper)
    at, r = (half, radius_b) if patch == 3 else (-half, radius_a)
    return on_ball(OK, wrench, at, r, n, xi)


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
