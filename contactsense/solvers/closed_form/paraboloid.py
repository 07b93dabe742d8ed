"""Paraboloid: a closed form without division by zero, the root of a complex number.

With (X, Y) = (sqrt(k1) x, sqrt(k2) y) the surface is z = -(X^2 + Y^2) / 2, and the balance is, as on the unit
sphere (`contactsense.solvers.closed_form.ellipsoid`), v = K (X, Y, 1) + x x u. Let -l = u . (X, Y, 1) and, as
complex numbers,

    P = X + iY,   A = u1 + i u2,   V = v1 + i v2,   W = u3 + i v3,   L = -l + iK

Then conj(A) P = L - W and L^2 = W^2 + 2i conj(A) V, whose imaginary part is 2 u . v. The pushing contact is
the root with l > 0, and

    P = 2i V / (L + W) = (L - W) / conj(A)

of which the form with the larger of L + W and L - W has no cancellation.
"""

from math import ldexp, sqrt

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector, divide, dot, norm
from contactsense.solvers.solution import (
    MISS,
    OK,
    PULLING,
    TANGENT,
    Answer,
    input_status,
    make_answer,
    no_contact,
)
from contactsense.solvers.units import LARGE, SMALL, Units, from_units, to_units, units_for
from contactsense.solvers.wrench import Wrench, invariant, pure_force

_FLAT, _SHARP = 1e-6, 1e6
"""Between these curvatures a body needs no other unit of length."""


@kernel
def _unit(u: Vector, v: Vector, tau: float) -> tuple[int, float, float, float]:
    """Solve v = K (X, Y, 1) + x x u on z = -(X^2 + Y^2) / 2 with tau = u . v.

    Returns:
        Status (`OK`, `PULLING`, `MISS`, `TANGENT`), X, Y, K; on a miss the point below which the line passes
        least far away, and K = 0.
    """
    aa = u[0] * u[0] + u[1] * u[1]
    real = u[2] * u[2] - v[2] * v[2] - 2.0 * (u[0] * v[1] - u[1] * v[0])
    size = abs(tau)
    # The maximum preserves the torsion if its square underflows.
    rho = max(sqrt(real * real + 4.0 * tau * tau), 2.0 * size)
    status = OK
    if aa == 0.0 and u[2] > 0.0:
        # Along the axis, from within.
        status = PULLING
        l, k = -u[2], v[2]  # noqa: E741
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
    if status <= PULLING and k * v[2] >= l * u[2]:
        # i V / (L + W), twice.
        re, im = u[2] - l, k + v[2]
        share = 2.0 / (re * re + im * im)
        return status, share * (v[0] * im - v[1] * re), share * (v[0] * re + v[1] * im), k
    re, im = -l - u[2], k - v[2]
    share = 1.0 / aa
    return status, share * (re * u[0] - im * u[1]), share * (re * u[1] + im * u[0]), k


@kernel
def _paraboloid(wrench: Wrench, tau: float, k1: float, k2: float) -> Answer:
    f, m = wrench
    r1, r2 = sqrt(k1), sqrt(k2)
    rr = r1 * r2
    status, px, py, k = _unit((r1 * f[0], r2 * f[1], f[2]), (r2 * m[0], r1 * m[1], rr * m[2]), rr * tau)
    gradient = (r1 * px, r2 * py, 1.0)
    slope = norm(gradient)
    n = divide(gradient, slope)
    xx, yy, zz = n[0] * n[0], n[1] * n[1], n[2] * n[2]
    trace = (k1 * (yy + zz) + k2 * (xx + zz)) / slope
    det = (rr * n[2] * n[2]) ** 2
    c = (px / r1, py / r2, -0.5 * (px * px + py * py))
    return make_answer(status, wrench, c, n, k * slope / rr, trace, det)


@kernel
def _units_for(wrench: Wrench, k1: float, k2: float) -> Units:
    """Units in which the curvatures' geometric mean is of order one; that of length has an exact root."""
    units = units_for(wrench, 1.0 / sqrt(k1) / sqrt(k2))
    return Units(units.force, units.moment, units.length - (units.length & 1))


@kernel
def solve_paraboloid(wrench: Wrench, k1: float, k2: float) -> Answer:
    """Contact centroid on z = -(k1 x^2 + k2 y^2) / 2, the body below.

    Args:
        wrench: Wrench on the body.
        k1, k2: Curvatures at the top.

    Returns:
        See `contactsense.solvers.solution`. There is a pushing solution for every wrench whose force and f.m
        are not zero, unless the force is along the axis from within.
    """
    f, m = wrench
    plain = min(k1, k2) > _FLAT and max(k1, k2) < _SHARP
    if plain and SMALL < dot(f, f) < LARGE and dot(m, m) < LARGE:
        return _paraboloid(wrench, invariant(wrench), k1, k2)
    status = input_status(wrench)
    if status != OK:
        return no_contact(status)
    units = _units_for(wrench, k1, k2)
    local = to_units(wrench, units)
    k1, k2 = ldexp(k1, units.length), ldexp(k2, units.length)
    return from_units(_paraboloid(local, invariant(local), k1, k2), units)


@kernel
def wrench_axis_paraboloid(wrench: Wrench, k1: float, k2: float) -> Answer:
    """Point where the wrench axis enters the paraboloid."""
    status = input_status(wrench)
    if status != OK:
        return no_contact(status)
    units = _units_for(wrench, k1, k2)
    line = pure_force(to_units(wrench, units))
    k1, k2 = ldexp(k1, units.length), ldexp(k2, units.length)
    return from_units(_paraboloid(line, 0.0, k1, k2), units)
