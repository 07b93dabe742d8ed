"""Initial guess on a smooth body, and nonlinear corrections of its steps, in units of its extent.

`initial_guess` and `warped_step` are for the packaged bodies; `ellipsoid_guess` and `unmodified_step` for
a user's function.
"""

from typing import Any

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector, add_scaled, dot
from contactsense.solvers.closed_form.box import patch_of_box
from contactsense.solvers.closed_form.ellipsoid import unit_sphere
from contactsense.solvers.general_convex.implicit_surfaces import SUPERQUADRIC, power, root
from contactsense.solvers.wrench import Wrench

_SOFT = 0.1
"""Assumed stiffness of the other coordinates; a smaller value moves a coordinate on a flat side earlier."""

_NEAR = 0.1
"""A coordinate that changes by a smaller share of itself needs no correction."""

_ROOTS = 2
_MIDDLE = 1e-3
"""|x|^p + |y|^p below which a cap of uneven exponents is as good as flat."""


@kernel
def ellipsoid_guess(size: Any, wrench: Wrench) -> Vector:
    """Contact on the ellipsoid of the body's extent; nearer to the centre if the line misses that."""
    u, v = wrench
    return unit_sphere(u, v, dot(u, v))[1]


@kernel
def unmodified_step(
    size: Any, tau: float, u: Vector, before: Vector, step: Vector, gradient: Vector
) -> Vector:
    """`warped_step` for a body without further structure: the step unchanged."""
    return step


@kernel
def _coordinate(
    alpha: float, beta: float, exponent: float, before: float, unmodified_step: float, slope: float
) -> float:
    """Approximate root of alpha x + beta |x|^(exponent - 1) = alpha straight + beta slope."""
    if abs(unmodified_step - before) <= _NEAR * abs(before):
        return unmodified_step
    total = alpha * unmodified_step + beta * slope
    if total == 0.0:
        return 0.0
    sign = 1.0 if total > 0.0 else -1.0
    total *= sign
    # The smaller of two upper bounds: from there Newton's method falls.
    x = total / alpha
    if beta * power(x, exponent - 2.0) > alpha:
        x = min(x, root(total / beta, exponent - 1.0))
    for _ in range(_ROOTS):
        steep = beta * power(x, exponent - 2.0)
        x = (total + (exponent - 2.0) * steep * x) / (alpha + (exponent - 1.0) * steep)
    return sign * x


@kernel
def warped_step(size: Any, tau: float, u: Vector, before: Vector, step: Vector, gradient: Vector) -> Vector:
    """Correct a step on a superquadric, coordinate by coordinate, for its nonlinear gradient.

    With the other coordinates at their optimum, the balance v = K g(x) + x x u requires of each coordinate
    approximately that alpha x + K |x|^(p - 1) has the value given by the osculating ellipsoid. A step in the
    gradient is inaccurate on a flat side, a step in the coordinate at an edge.

    If K is less than the push l, |x|^(p - 1) is nearly linear and no correction is needed.

    Args:
        size: The body.
        tau: |u . v| = K l.
        u: Force.
        before: Where the step began.
        step, gradient: Where it ends on the osculating ellipsoid, and the gradient there.

    Returns:
        Where it ends on the body, about.
    """
    if size[0] != SUPERQUADRIC:
        return step
    push = abs(dot(u, gradient))
    if not tau > push * push > 0.0:
        return step
    alpha = _SOFT * push * push
    p, q = size[4], size[5]
    x, y, _ = before
    nx, ny, _ = step
    gx, gy, _ = gradient
    nz = _coordinate(alpha, tau, q, before[2], step[2], gradient[2])
    if p == q:
        return _coordinate(alpha, tau, p, x, nx, gx), _coordinate(alpha, tau, p, y, ny, gy), nz
    flat = power(abs(x), p) + power(abs(y), p)
    if p > 2.0 and flat > _MIDDLE:
        rise = flat ** (q / p - 1.0)
        nx = _coordinate(alpha, rise * tau, p, x, nx, gx / rise)
        ny = _coordinate(alpha, rise * tau, p, y, ny, gy / rise)
    return nx, ny, nz


@kernel
def initial_guess(size: Any, wrench: Wrench) -> Vector:
    """The contact on the ellipsoid of the body's extent, or for a superquadric on the rounded box that has
    the corners of its exponent along z."""
    if size[0] != SUPERQUADRIC:
        return ellipsoid_guess(size, wrench)
    exponent = size[5]
    # Within half a percent: its corner is at 3^(-1 / exponent), that of the box at 1 - (1 - 1 / sqrt(3)) r.
    rounding = 2.6 / (exponent + 0.6)
    flat = 1.0 - rounding
    patch = patch_of_box(wrench, (flat, flat, flat), rounding)
    if patch.outside < 1.0:
        return add_scaled(patch.core, rounding, patch.normal)
    return ellipsoid_guess(size, wrench)
