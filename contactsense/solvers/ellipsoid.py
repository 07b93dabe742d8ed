"""Ellipsoid and sphere: the paper's closed form (section 5), without division by zero.

With x = c / (a, b, c) on the unit sphere, u = (bc f1, ca f2, ab f3) and v = (a m1, b m2, c m3), the
balance m = xi n + c x f becomes v = K x + x x u: every ellipsoid is the unit sphere. There K and l = -u.x
satisfy

    K^2 - l^2 = |v|^2 - |u|^2 = sigma,      K l = -u.v = -tau,

so one of them follows, up to sign, from the branch of (16) without cancellation, and the other from their
product. Zero torsion is not a special case: there K = 0 and the result is the wrench-axis solution.
"""

from math import ldexp, sqrt

from contactsense.solvers.solution import (
    LARGE,
    MISS,
    OK,
    SMALL,
    TANGENT,
    Answer,
    input_status,
    invariant,
    make_answer,
    no_contact,
    rescaled,
    scaled,
    unit_exponents,
)
from contactsense.solvers.typed_kernel import kernel

_MAX_UNSCALED_SIZE = 1e6
"""Bodies below this size need no scaled unit of length."""


@kernel
def unit_sphere(
    ux: float, uy: float, uz: float, vx: float, vy: float, vz: float, uu: float, vv: float, tau: float
) -> tuple[int, float, float, float, float]:
    """Solve v = K x + x x u, |x| = 1, u.x < 0.

    Args:
        ux, uy, uz, vx, vy, vz: The wrench, u not zero.
        uu, vv: Their squares.
        tau: u.v, from the wrench before its units were changed, so that its sign is right.

    Returns:
        Status (`OK`, `MISS`, `TANGENT`), x, y, z, K. On a miss the point nearest to the line, and K = 0.
    """
    size = abs(tau)
    sigma = vv - uu
    # The maximum preserves the torsion if its square underflows.
    rho = max(sqrt(sigma * sigma + 4.0 * tau * tau), 2.0 * size)
    status = OK
    if sigma < 0.0:
        l = sqrt(0.5 * (rho - sigma))  # noqa: E741
        k = size / l
    elif tau != 0.0:
        k = sqrt(0.5 * (rho + sigma))
        l = size / k  # noqa: E741
    else:
        k = l = 0.0  # noqa: E741
        status = MISS if sigma > 0.0 else TANGENT
    if tau > 0.0:
        k = -k
    inverse = 1.0 / (k * k + uu) if status == OK else 1.0 / sqrt(uu * vv)
    x = (k * vx + (uy * vz - uz * vy) - l * ux) * inverse
    y = (k * vy + (uz * vx - ux * vz) - l * uy) * inverse
    z = (k * vz + (ux * vy - uy * vx) - l * uz) * inverse
    return status, x, y, z, k


@kernel
def _ellipsoid(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, a: float, b: float, c: float
) -> Answer:
    bc, ca, ab = b * c, c * a, a * b
    ux, uy, uz = bc * fx, ca * fy, ab * fz
    vx, vy, vz = a * mx, b * my, c * mz
    uu = ux * ux + uy * uy + uz * uz
    vv = vx * vx + vy * vy + vz * vz
    volume = a * bc
    tau = volume * invariant(fx, fy, fz, mx, my, mz)
    status, x, y, z, k = unit_sphere(ux, uy, uz, vx, vy, vz, uu, vv, tau)
    nx, ny, nz = bc * x, ca * y, ab * z
    slope = sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = nx / slope, ny / slope, nz / slope
    # (1 - n1^2) etc. as sums: no cancellation in the mean curvature of a needle.
    xx, yy, zz = nx * nx, ny * ny, nz * nz
    trace = (bc * bc * (yy + zz) + ca * ca * (zz + xx) + ab * ab * (xx + yy)) / (volume * slope)
    root = volume / (slope * slope)
    xi = k * slope / volume
    return make_answer(
        status, fx, fy, fz, mx, my, mz, a * x, b * y, c * z, nx, ny, nz, xi, trace, root * root
    )


@kernel
def _sphere(fx: float, fy: float, fz: float, mx: float, my: float, mz: float, radius: float) -> Answer:
    ux, uy, uz = radius * fx, radius * fy, radius * fz
    uu = ux * ux + uy * uy + uz * uz
    vv = mx * mx + my * my + mz * mz
    tau = radius * invariant(fx, fy, fz, mx, my, mz)
    status, x, y, z, xi = unit_sphere(ux, uy, uz, mx, my, mz, uu, vv, tau)
    cx, cy, cz = radius * x, radius * y, radius * z
    bend = 1.0 / radius
    return make_answer(status, fx, fy, fz, mx, my, mz, cx, cy, cz, x, y, z, xi, 2.0 * bend, bend * bend)


@kernel
def solve_ellipsoid(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, a: float, b: float, c: float
) -> Answer:
    """Contact centroid on an ellipsoid about the origin (paper, (14) and (16)).

    Args:
        fx, fy, fz, mx, my, mz: Wrench on the body.
        a, b, c: Semi-axes along x, y, z.

    Returns:
        See `contactsense.solvers.solution`. A pushing solution exists for every wrench whose force and f.m
        are not zero.
    """
    size = max(a, b, c)
    smallest = min(a, b, c)
    square = smallest * smallest
    ff = fx * fx + fy * fy + fz * fz
    mm = mx * mx + my * my + mz * mz
    if square * square * ff > SMALL and ff < LARGE and mm < LARGE and size < _MAX_UNSCALED_SIZE:
        return _ellipsoid(fx, fy, fz, mx, my, mz, a, b, c)
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    e, g, k = unit_exponents(fx, fy, fz, mx, my, mz, size)
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, k)
    a, b, c = ldexp(a, -k), ldexp(b, -k), ldexp(c, -k)
    return rescaled(_ellipsoid(fx, fy, fz, mx, my, mz, a, b, c), e, g, k)


@kernel
def solve_sphere(fx: float, fy: float, fz: float, mx: float, my: float, mz: float, radius: float) -> Answer:
    """Contact centroid on a sphere of that radius about the origin (paper, section 5.1.1)."""
    ff = radius * radius * (fx * fx + fy * fy + fz * fz)
    mm = mx * mx + my * my + mz * mz
    if SMALL < ff < LARGE and mm < LARGE:
        return _sphere(fx, fy, fz, mx, my, mz, radius)
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    e, g, k = unit_exponents(fx, fy, fz, mx, my, mz, radius)
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, k)
    return rescaled(_sphere(fx, fy, fz, mx, my, mz, ldexp(radius, -k)), e, g, k)
