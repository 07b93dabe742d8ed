"""Ellipsoid and sphere: the paper's closed form (section 5), without division by zero.

With x = c / (a, b, c) on the unit sphere, u = (bc f1, ca f2, ab f3) and v = (a m1, b m2, c m3), the
balance m = xi n + c x f becomes v = K x + x x u: every ellipsoid is the unit sphere. There K and l = -u.x
satisfy

    K^2 - l^2 = |v|^2 - |u|^2 = sigma,      K l = -u.v = -tau,

so one of them follows, up to sign, from the branch of (16) without cancellation, and the other from their
product. Zero torsion is not a special case: there K = 0 and the result is the wrench-axis solution.
"""

from math import sqrt

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector, add_scaled, cross, divide, dot, norm, scale
from contactsense.solvers.solution import MISS, OK, TANGENT, Answer, make_answer, no_contact
from contactsense.solvers.units import LARGE, SMALL, from_units, in_units, length_to_units
from contactsense.solvers.wrench import Wrench, about_height, invariant

_MAX_UNSCALED_SIZE = 1e6
"""Bodies below this size need no scaled unit of length."""


@kernel
def unit_sphere(u: Vector, v: Vector, tau: float) -> tuple[int, Vector, float]:
    """Solve v = K x + x x u, |x| = 1, u.x < 0.

    Args:
        u, v: The wrench, u not zero.
        tau: u.v, from the wrench before its units were changed, so that its sign is right.

    Returns:
        Status (`OK`, `MISS`, `TANGENT`), x, K. On a miss the point nearest to the line, and K = 0.
    """
    uu, vv = dot(u, u), dot(v, v)
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
    w = cross(u, v)
    x = (k * v[0] + w[0] - l * u[0], k * v[1] + w[1] - l * u[1], k * v[2] + w[2] - l * u[2])
    return status, scale(inverse, x), k


@kernel
def _ellipsoid(wrench: Wrench, a: float, b: float, c: float) -> Answer:
    f, m = wrench
    bc, ca, ab = b * c, c * a, a * b
    volume = a * bc
    u, v = (bc * f[0], ca * f[1], ab * f[2]), (a * m[0], b * m[1], c * m[2])
    status, x, k = unit_sphere(u, v, volume * invariant(wrench))
    gradient = (bc * x[0], ca * x[1], ab * x[2])
    slope = norm(gradient)
    n = divide(gradient, slope)
    # (1 - n1^2) etc. as sums: no cancellation in the mean curvature of a needle.
    xx, yy, zz = n[0] * n[0], n[1] * n[1], n[2] * n[2]
    trace = (bc * bc * (yy + zz) + ca * ca * (zz + xx) + ab * ab * (xx + yy)) / (volume * slope)
    root = volume / (slope * slope)
    xi = k * slope / volume
    return make_answer(status, wrench, (a * x[0], b * x[1], c * x[2]), n, xi, trace, root * root)


@kernel
def ball(wrench: Wrench, z: float, radius: float) -> tuple[int, Vector, float]:
    """Contact on a ball about (0, 0, z): status, outward normal, torsion."""
    moment = about_height(wrench, z).moment
    return unit_sphere(scale(radius, wrench.force), moment, radius * invariant(wrench))


@kernel
def on_ball(status: int, wrench: Wrench, z: float, radius: float, n: Vector, xi: float) -> Answer:
    """Answer for a contact with the normal n and the torsion xi on a ball about (0, 0, z)."""
    bend = 1.0 / radius
    c = add_scaled((0.0, 0.0, z), radius, n)
    return make_answer(status, wrench, c, n, xi, 2.0 * bend, bend * bend)


@kernel
def solve_ellipsoid(wrench: Wrench, a: float, b: float, c: float) -> Answer:
    """Contact centroid on an ellipsoid about the origin (paper, (14) and (16)).

    Args:
        wrench: Wrench on the body.
        a, b, c: Semi-axes along x, y, z.

    Returns:
        See `contactsense.solvers.solution`. A pushing solution exists for every wrench whose force and f.m
        are not zero.
    """
    f, m = wrench
    size = max(a, b, c)
    smallest = min(a, b, c)
    square = smallest * smallest
    ff = dot(f, f)
    if square * square * ff > SMALL and ff < LARGE and dot(m, m) < LARGE and size < _MAX_UNSCALED_SIZE:
        return _ellipsoid(wrench, a, b, c)
    status, local, units = in_units(wrench, size)
    if status != OK:
        return no_contact(status)
    a, b, c = length_to_units(a, units), length_to_units(b, units), length_to_units(c, units)
    return from_units(_ellipsoid(local, a, b, c), units)


@kernel
def _sphere(wrench: Wrench, radius: float) -> Answer:
    status, n, xi = ball(wrench, 0.0, radius)
    return on_ball(status, wrench, 0.0, radius, n, xi)


@kernel
def solve_sphere(wrench: Wrench, radius: float) -> Answer:
    """Contact centroid on a sphere of that radius about the origin (paper, section 5.1.1)."""
    f, m = wrench
    if SMALL < radius * radius * dot(f, f) < LARGE and dot(m, m) < LARGE:
        return _sphere(wrench, radius)
    status, local, units = in_units(wrench, radius)
    if status != OK:
        return no_contact(status)
    return from_units(_sphere(local, length_to_units(radius, units)), units)
