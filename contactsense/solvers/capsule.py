"""Capsule and tapered capsule: two spheres and the cone (or cylinder) tangent to both, each in closed
form.

The normals of the patches agree where they meet, so exactly one contains the contact (paper, section 7).
If rounding errors place the contact outside both, the nearer patch is used, so there is no gap.
"""

from math import ldexp, sqrt

from contactsense.solvers.cylinder import directions, height, lateral_frame, on_lateral
from contactsense.solvers.ellipsoid import unit_sphere
from contactsense.solvers.nearest_point import TAPERED, nearest_to_line
from contactsense.solvers.solution import (
    LARGE,
    OK,
    SMALL,
    Answer,
    input_status,
    invariant,
    make_answer,
    no_contact,
    rescaled,
    scaled,
    sum_error,
    unit_exponents,
)
from contactsense.solvers.typed_kernel import kernel

PATCH_TOLERANCE = 1e-9
"""Tolerance of a contact outside its patch, relative to the size of the body, for rounding errors."""


@kernel
def ball(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, at: float, radius: float
) -> tuple[int, float, float, float, float]:
    """Contact on a ball with centre (0, 0, at): status, outward normal, torsion."""
    lx, ly = mx + at * fy, my - at * fx
    ux, uy, uz = radius * fx, radius * fy, radius * fz
    uu, vv = ux * ux + uy * uy + uz * uz, lx * lx + ly * ly + mz * mz
    tau = radius * invariant(fx, fy, fz, mx, my, mz)
    return unit_sphere(ux, uy, uz, lx, ly, mz, uu, vv, tau)


@kernel
def _tapered_capsule(
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
    # 1 - sin_beta as the one exact difference that a steep side needs.
    length, drop = 2.0 * half, radius_a - radius_b
    error = sum_error(radius_a, -radius_b, drop)
    less, more = (length - drop) - error, (length + drop) + error
    sin_beta, cos_beta = drop / length, sqrt(less * more) / length
    taper = drop / sqrt(less * more)
    mean = 0.5 * (radius_a + radius_b)
    radius = mean / cos_beta
    apex = mean / sin_beta if sin_beta != 0.0 else 0.0
    lx, ly, base, below = lateral_frame(fx, fy, mx, my, radius, taper, apex)
    best, patch, high = 1e300, 0, True
    ex = ey = z = rho = nx = ny = nz = xi = 0.0
    disc, a, b, u, v = directions(fx, fy, lx, ly, mz, base, taper)
    if disc > 0.0:
        for sign in (-1.0, 1.0):
            ax, ay = a + sign * u, b + sign * v
            at, push = height(fx, fy, fz, lx, ly, ax, ay, base, taper)
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
            status, sx, sy, sz, k = ball(fx, fy, fz, mx, my, mz, at, r)
            outside = r * ((sin_beta - sz) if top else (sz - sin_beta))
            if status == OK and outside < best:
                best, patch = outside, 3 if top else 2
                nx, ny, nz, xi = sx, sy, sz, k
            if best <= 0.0:
                break
    if best > PATCH_TOLERANCE * (half + max(radius_a, radius_b)):
        size = (half, radius_a, radius_b, 0.0)
        return nearest_to_line(TAPERED, size, half + max(radius_a, radius_b), fx, fy, fz, mx, my, mz)
    if patch == 1:
        return on_lateral(OK, fx, fy, fz, mx, my, mz, ex, ey, z, rho, taper)
    at, r = (half, radius_b) if patch == 3 else (-half, radius_a)
    bend = 1.0 / r
    return make_answer(
        OK, fx, fy, fz, mx, my, mz, r * nx, r * ny, at + r * nz, nx, ny, nz, xi, 2.0 * bend, bend * bend
    )


@kernel
def solve_tapered_capsule(
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
    """Contact centroid on the convex hull of two balls on z.

    Args:
        fx, fy, fz, mx, my, mz: Wrench on the body.
        half: Half the distance of their centres, (0, 0, -half) and (0, 0, half).
        radius_a, radius_b: Of the lower and the upper ball; they differ by less than 2 half.

    Returns:
        See `contactsense.solvers.solution`.
    """
    size = max(radius_a, radius_b)
    ff = fx * fx + fy * fy + fz * fz
    mm = mx * mx + my * my + mz * mz
    if SMALL < size * size * ff < LARGE and mm < LARGE and half * half * ff < LARGE:
        return _tapered_capsule(fx, fy, fz, mx, my, mz, half, radius_a, radius_b)
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    e, g, k = unit_exponents(fx, fy, fz, mx, my, mz, half + size)
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, k)
    half, radius_a, radius_b = ldexp(half, -k), ldexp(radius_a, -k), ldexp(radius_b, -k)
    return rescaled(_tapered_capsule(fx, fy, fz, mx, my, mz, half, radius_a, radius_b), e, g, k)


@kernel
def solve_capsule(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, half: float, radius: float
) -> Answer:
    """Contact centroid on a capsule about z, the ends of its segment at (0, 0, -half) and (0, 0, half)."""
    return solve_tapered_capsule(fx, fy, fz, mx, my, mz, half, radius, radius)
