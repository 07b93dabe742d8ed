"""The wrench on a body as the solvers take it, and what follows from it alone."""

from typing import NamedTuple

import numpy as np

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector, add_scaled, cross, divide, dot, rotate_back, subtract

_SPLIT = 134217729.0
"""2^27 + 1 splits a float into two halves whose products are exact."""

_CANCELLED = 1e-3
"""Sum relative to its terms below which its rounding errors are added."""


class Wrench(NamedTuple):
    """A wrench on a body, in the frame in which its surface is described."""

    force: Vector
    """Force on the body [N]."""
    moment: Vector
    """Moment on the body about the frame's origin [Nm]."""


def wrench_of(force: np.ndarray, moment: np.ndarray) -> Wrench:
    """The wrench of a force and a moment, shape (3,) each."""
    (fx, fy, fz), (mx, my, mz) = force.tolist(), moment.tolist()
    return Wrench((fx, fy, fz), (mx, my, mz))


@kernel
def moment_about(wrench: Wrench, point: Vector) -> Vector:
    """Moment about a point p: m - p x f."""
    return subtract(wrench.moment, cross(point, wrench.force))


@kernel
def about(wrench: Wrench, point: Vector) -> Wrench:
    """The wrench with its moment about another point."""
    return Wrench(wrench.force, moment_about(wrench, point))


@kernel
def about_height(wrench: Wrench, z: float) -> Wrench:
    """The wrench with its moment about (0, 0, z)."""
    f, m = wrench
    return Wrench(f, (m[0] + z * f[1], m[1] - z * f[0], m[2]))


@kernel
def in_frame(wrench: Wrench, rotation: np.ndarray, origin: Vector) -> Wrench:
    """The wrench in a frame with that orientation, shape (3, 3), and origin."""
    return Wrench(rotate_back(rotation, wrench.force), rotate_back(rotation, moment_about(wrench, origin)))


@kernel
def line_point(wrench: Wrench) -> Vector:
    """Point of the force's line that is nearest to the origin (paper, equation 6)."""
    f, m = wrench
    return divide(cross(f, m), dot(f, f))


@kernel
def pure_force(wrench: Wrench) -> Wrench:
    """The wrench without its moment along the force: a pure force on the same line."""
    f, m = wrench
    pitch = dot(f, m) / dot(f, f)
    return Wrench(f, add_scaled(m, -pitch, f))


@kernel
def _product_error(x: float, y: float, product: float) -> float:
    """x y - product, exactly (Dekker 1971), unless it leaves the range of floats."""
    a = _SPLIT * x
    a = a - (a - x)
    b = _SPLIT * y
    b = b - (b - y)
    return ((a * b - product) + a * (y - b) + (x - a) * b) + (x - a) * (y - b)


@kernel
def sum_error(x: float, y: float, total: float) -> float:
    """x + y - total, exactly (Knuth 1969)."""
    back = total - x
    return (x - (total - back)) + (y - back)


@kernel
def invariant(wrench: Wrench) -> float:
    """f.m = xi (f.n), which is the same about any origin.

    Its sign decides between a contact and its twin, and zero is a pure force. So where the products cancel,
    it is summed as in twice the precision (Ogita, Rump & Oishi 2005).
    """
    f, m = wrench
    x, y, z = f[0] * m[0], f[1] * m[1], f[2] * m[2]
    half = x + y
    total = half + z
    if abs(total) > _CANCELLED * (abs(x) + abs(y) + abs(z)):
        return total
    error = _product_error(f[0], m[0], x) + _product_error(f[1], m[1], y) + _product_error(f[2], m[2], z)
    return total + (error + (sum_error(x, y, half) + sum_error(half, z, total)))
