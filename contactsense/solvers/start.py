"""Where to begin on a smooth body, and how a step bends with it, in units of its extent.

`first` and `bend` are for the packaged bodies; `first_of_any` and `straight` for a function of one's own.
"""

from typing import Any

from contactsense.solvers.box import patch_of_box
from contactsense.solvers.ellipsoid import unit_sphere
from contactsense.solvers.implicit import SUPERQUADRIC, power, root
from contactsense.solvers.level import Point
from contactsense.solvers.typed import kernel

_SOFT = 0.1
"""How stiff the other coordinates are taken to be beside what force and normal say; less lets one that is
nearly on its flat move sooner."""

_NEAR = 0.1
"""A coordinate that moves by less than this share of itself needs no bend."""

_ROOTS = 2
_MIDDLE = 1e-3
"""|x|^p + |y|^p below which a cap of uneven exponents is as good as flat."""


@kernel
def first_of_any(size: Any, ux: float, uy: float, uz: float, vx: float, vy: float, vz: float) -> Point:
    """The contact on the ellipsoid of the body's extent; nearer to the middle if the line there passes by."""
    uu = ux * ux + uy * uy + uz * uz
    _, x, y, z, _ = unit_sphere(ux, uy, uz, vx, vy, vz, uu, vx * vx + vy * vy + vz * vz)
    return x, y, z


@kernel
def straight(
    size: Any,
    tau: float,
    ux: float,
    uy: float,
    uz: float,
    x: float,
    y: float,
    z: float,
    px: float,
    py: float,
    pz: float,
    gx: float,
    gy: float,
    gz: float,
) -> Point:
    """`bend` for a body of which nothing more is known: the step as it is."""
    return px, py, pz


@kernel
def _coordinate(
    alpha: float, beta: float, exponent: float, before: float, straight: float, slope: float
) -> float:
    """The root of alpha x + beta |x|^(exponent - 1) = alpha straight + beta slope, about."""
    if abs(straight - before) <= _NEAR * abs(before):
        return straight
    total = alpha * straight + beta * slope
    if total == 0.0:
        return 0.0
    sign = 1.0 if total > 0.0 else -1.0
    total *= sign
    # The least of two that are too large: from there Newton's method falls.
    x = total / alpha
    if beta * power(x, exponent - 2.0) > alpha:
        x = min(x, root(total / beta, exponent - 1.0))
    for _ in range(_ROOTS):
        steep = beta * power(x, exponent - 2.0)
        x = (total + (exponent - 2.0) * steep * x) / (alpha + (exponent - 1.0) * steep)
    return sign * x


@kernel
def bend(
    size: Any,
    tau: float,
    ux: float,
    uy: float,
    uz: float,
    x: float,
    y: float,
    z: float,
    px: float,
    py: float,
    pz: float,
    gx: float,
    gy: float,
    gz: float,
) -> Point:
    """A step on a superquadric, coordinate by coordinate, as its gradient bends.

    The balance v = K g(x) + x x u asks of each coordinate, with the others at their best, about that
    alpha x + K |x|^(p - 1) is what the osculating ellipsoid says it is: on a flat the gradient is the wrong
    unknown, at an edge the coordinate is.

    Where K < l = push, |x|^(p - 1) bends too little to matter.

    Args:
        size: The body.
        tau: |u . v| = K l.
        ux, uy, uz: Force.
        x, y, z: Where the step began.
        px, py, pz, gx, gy, gz: Where it ends on the osculating ellipsoid, and the gradient there.

    Returns:
        Where it ends on the body, about.
    """
    if size[0] != SUPERQUADRIC:
        return px, py, pz
    push = abs(ux * gx + uy * gy + uz * gz)
    if not tau > push * push > 0.0:
        return px, py, pz
    alpha = _SOFT * push * push
    p, q = size[4], size[5]
    nz = _coordinate(alpha, tau, q, z, pz, gz)
    if p == q:
        return _coordinate(alpha, tau, p, x, px, gx), _coordinate(alpha, tau, p, y, py, gy), nz
    nx, ny = px, py
    flat = power(abs(x), p) + power(abs(y), p)
    if p > 2.0 and flat > _MIDDLE:
        rise = flat ** (q / p - 1.0)
        nx = _coordinate(alpha, rise * tau, p, x, px, gx / rise)
        ny = _coordinate(alpha, rise * tau, p, y, py, gy / rise)
    return nx, ny, nz


@kernel
def first(size: Any, ux: float, uy: float, uz: float, vx: float, vy: float, vz: float) -> Point:
    """The contact on the ellipsoid of the body's extent, or for a superquadric on the rounded box that has
    the corners of its exponent along z."""
    if size[0] != SUPERQUADRIC:
        return first_of_any(size, ux, uy, uz, vx, vy, vz)
    exponent = size[5]
    # Within half a percent: its corner is at 3^(-1 / exponent), that of the box at 1 - (1 - 1 / sqrt(3)) r.
    rounding = 2.6 / (exponent + 0.6)
    flat = 1.0 - rounding
    outside, x, y, z, nx, ny, nz, _ = patch_of_box(ux, uy, uz, vx, vy, vz, flat, flat, flat, rounding)
    if outside < 1.0:
        return x + rounding * nx, y + rounding * ny, z + rounding * nz
    return first_of_any(size, ux, uy, uz, vx, vy, vz)
