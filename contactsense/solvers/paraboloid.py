"""Paraboloid: a closed form without division by zero, the root of a complex number.

With (X, Y) = (sqrt(k1) x, sqrt(k2) y) the surface is z = -(X^2 + Y^2) / 2, and the balance is, as on the unit
sphere (`contactsense.solvers.ellipsoid`), v = K (X, Y, 1) + x x u. Let -l = u . (X, Y, 1) and, as complex
numbers,

    P = X + iY,   A = u1 + i u2,   V = v1 + i v2,   W = u3 + i v3,   L = -l + iK

Then conj(A) P = L - W and L^2 = W^2 + 2i conj(A) V, whose imaginary part is 2 u . v. The pushing contact is
the root with l > 0, and

    P = 2i V / (L + W) = (L - W) / conj(A)

of which the form with the larger of L + W and L - W has no cancellation.
"""

from math import ldexp, sqrt

from contactsense.solvers.solution import (
    LARGE,
    MISS,
    OK,
    PULLING,
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

_FLAT, _SHARP = 1e-6, 1e6
"""Between these curvatures a body needs no other unit of length."""


@kernel
def _unit(
    ux: float, uy: float, uz: float, vx: float, vy: float, vz: float, tau: float
) -> tuple[int, float, float, float]:
    """Solve v = K (X, Y, 1) + x x u on z = -(X^2 + Y^2) / 2 with tau = u . v.

    Returns:
        Status (`OK`, `PULLING`, `MISS`, `TANGENT`), X, Y, K; on a miss the point below which the line passes
        least far away, and K = 0.
    """
    aa = ux * ux + uy * uy
    real = uz * uz - vz * vz - 2.0 * (ux * vy - uy * vx)
    size = abs(tau)
    # The maximum preserves the torsion if its square underflows.
    rho = max(sqrt(real * real + 4.0 * tau * tau), 2.0 * size)
    status = OK
    if aa == 0.0 and uz > 0.0:
        # Along the axis, from within.
        status = PULLING
        l, k = -uz, vz  # noqa: E741
    elif real > 0.0:
        l = sqrt(0.5 * (rho + real))  # noqa: E741
        k = -tau / l
    elif tau != 0.0:
        k = sqrt(0.5 * (rho - real))
        l = size / k  # noqa: E741
        if tau > 0.0:
            k = -k
    else:
        l = k = 0.0  # noqa: E741
        status = MISS if real < 0.0 else TANGENT
    if status <= PULLING and k * vz >= l * uz:
        # i V / (L + W), twice.
        re, im = uz - l, k + vz
        share = 2.0 / (re * re + im * im)
        return status, share * (vx * im - vy * re), share * (vx * re + vy * im), k
    re, im = -l - uz, k - vz
    share = 1.0 / aa
    return status, share * (re * ux - im * uy), share * (re * uy + im * ux), k


@kernel
def _paraboloid(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, tau: float, k1: float, k2: float
) -> Answer:
    r1, r2 = sqrt(k1), sqrt(k2)
    rr = r1 * r2
    status, px, py, k = _unit(r1 * fx, r2 * fy, fz, r2 * mx, r1 * my, rr * mz, rr * tau)
    gx, gy = r1 * px, r2 * py
    slope = sqrt(gx * gx + gy * gy + 1.0)
    nx, ny, nz = gx / slope, gy / slope, 1.0 / slope
    trace = (k1 * (ny * ny + nz * nz) + k2 * (nx * nx + nz * nz)) / slope
    det = (rr * nz * nz) ** 2
    cx, cy, cz = px / r1, py / r2, -0.5 * (px * px + py * py)
    return make_answer(status, fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz, k * slope / rr, trace, det)


@kernel
def solve_paraboloid(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, k1: float, k2: float
) -> Answer:
    """Contact centroid on z = -(k1 x^2 + k2 y^2) / 2, the body below.

    Args:
        fx, fy, fz, mx, my, mz: Wrench on the body.
        k1, k2: Curvatures at the top.

    Returns:
        See `contactsense.solvers.solution`. There is a pushing solution for every wrench whose force and f.m
        are not zero, unless the force is along the axis from within.
    """
    ff = fx * fx + fy * fy + fz * fz
    mm = mx * mx + my * my + mz * mz
    plain = min(k1, k2) > _FLAT and max(k1, k2) < _SHARP
    if plain and SMALL < ff < LARGE and mm < LARGE:
        return _paraboloid(fx, fy, fz, mx, my, mz, invariant(fx, fy, fz, mx, my, mz), k1, k2)
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    e, g, k = unit_exponents(fx, fy, fz, mx, my, mz, 1.0 / sqrt(k1) / sqrt(k2))
    # An even exponent has an exact root.
    k -= k & 1
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, k)
    k1, k2 = ldexp(k1, k), ldexp(k2, k)
    return rescaled(_paraboloid(fx, fy, fz, mx, my, mz, invariant(fx, fy, fz, mx, my, mz), k1, k2), e, g, k)


@kernel
def wrench_axis_paraboloid(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, k1: float, k2: float
) -> Answer:
    """Point where the wrench axis enters the paraboloid."""
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    e, g, k = unit_exponents(fx, fy, fz, mx, my, mz, 1.0 / sqrt(k1) / sqrt(k2))
    # An even exponent has an exact root.
    k -= k & 1
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, k)
    pitch = (fx * mx + fy * my + fz * mz) / (fx * fx + fy * fy + fz * fz)
    k1, k2 = ldexp(k1, k), ldexp(k2, k)
    answer = _paraboloid(fx, fy, fz, mx - pitch * fx, my - pitch * fy, mz - pitch * fz, 0.0, k1, k2)
    return rescaled(answer, e, g, k)
