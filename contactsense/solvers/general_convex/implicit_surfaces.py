"""Smooth convex bodies as level sets: value, gradient and Hessian of a convex function, zero on the
surface.

The functions of the packaged bodies are gauges minus one: homogeneous of degree one about the origin, so
that c / (1 + value) lies on the surface for any c. The paraboloid, open at one end, is an exception.
"""

from math import copysign, frexp, ldexp, sqrt
from typing import Any

from contactsense.robots.jit.kernel import kernel

ELLIPSOID, SUPERQUADRIC, PARABOLOID = 0.0, 1.0, 2.0
"""First number of a body's size; the others are described at `evaluate`."""

Size = tuple[float, float, float, float, float, float]
Level = tuple[float, float, float, float, float, float, float, float, float, float]
"""Value, gradient (x, y, z), Hessian (xx, yy, zz, xy, xz, yz)."""


@kernel
def power(x: float, exponent: float) -> float:
    """x^exponent for x >= 0, fast for the usual exponents of superquadrics."""
    if exponent == 2.0:
        return x * x
    if exponent == 0.0:
        return 1.0
    if exponent == 4.0:
        square = x * x
        return square * square
    if exponent == 6.0:
        square = x * x
        return square * square * square
    return float(x**exponent)


@kernel
def root(x: float, exponent: float) -> float:
    """x^(1 / exponent) for x >= 0."""
    if exponent == 2.0:
        return sqrt(x)
    if exponent == 4.0:
        return sqrt(sqrt(x))
    return float(x ** (1.0 / exponent))


@kernel
def _even(a: float, b: float, c: float, p: float, x: float, y: float, z: float) -> Level:
    # Gauge N = (|a x|^p + |b y|^p + |c z|^p)^(1/p).
    ax, by, cz = a * x, b * y, c * z
    u, v, w = power(abs(ax), p - 2.0), power(abs(by), p - 2.0), power(abs(cz), p - 2.0)
    gx, gy, gz = u * ax, v * by, w * cz
    total = gx * ax + gy * by + gz * cz
    if total == 0.0:
        return -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    gauge = root(total, p)
    i = 1.0 / total
    drop = gauge * i
    back = (1.0 - p) * drop * i
    turn = (p - 1.0) * drop
    gx, gy, gz = a * gx, b * gy, c * gz
    kx, ky, kz = back * gx, back * gy, back * gz
    return (
        gauge - 1.0,
        drop * gx,
        drop * gy,
        drop * gz,
        turn * u * (a * a) + kx * gx,
        turn * v * (b * b) + ky * gy,
        turn * w * (c * c) + kz * gz,
        kx * gy,
        kx * gz,
        ky * gz,
    )


@kernel
def _superquadric(a: float, b: float, c: float, p: float, q: float, x: float, y: float, z: float) -> Level:
    # Gauge N = ((|a x|^p + |b y|^p)^(q/p) + |c z|^q)^(1/q), with a, b, c one over the semi-axes.
    u, v, w = abs(a * x), abs(b * y), abs(c * z)
    up, vp, wq = power(u, p - 2.0), power(v, p - 2.0), power(w, q - 2.0)
    du, dv, dw = up * u, vp * v, wq * w
    flat = du * u + dv * v
    curl = 0.0
    if p != q and flat > 0.0:
        rise = flat ** (q / p - 1.0)
        curl = (q - p) / (flat * rise)
        up, vp, du, dv, flat = rise * up, rise * vp, rise * du, rise * dv, rise * flat
    total = flat + dw * w
    if total == 0.0:
        return -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    gauge = root(total, q)
    # With G = N^q: G_u = q u^(p-1) (...)^(q/p-1), and N_u = N^(1-q) G_u / q.
    drop = gauge / total
    gu, gv, gw = drop * du, drop * dv, drop * dw
    back = (1.0 - q) / gauge
    turn = drop * curl
    huu = drop * (p - 1.0) * up + turn * du * du + back * gu * gu
    hvv = drop * (p - 1.0) * vp + turn * dv * dv + back * gv * gv
    hww = drop * (q - 1.0) * wq + back * gw * gw
    huv = turn * du * dv + back * gu * gv
    huw, hvw = back * gu * gw, back * gv * gw
    ax, by, cz = copysign(a, x), copysign(b, y), copysign(c, z)
    return (
        gauge - 1.0,
        gu * ax,
        gv * by,
        gw * cz,
        huu * a * a,
        hvv * b * b,
        hww * c * c,
        huv * ax * by,
        huw * ax * cz,
        hvw * by * cz,
    )


@kernel
def evaluate(size: Size, x: float, y: float, z: float) -> Level:
    """Value, gradient and Hessian of a packaged body's function.

    Args:
        size: (`ELLIPSOID`, a, b, c, ...): one over the semi-axes. (`SUPERQUADRIC`, a, b, c, p, q): semi-axes,
            exponents across and along z, at least 2. (`PARABOLOID`, k1, k2, ...): z = -(k1 x^2 + k2 y^2) / 2,
            the body below.
        x, y, z: Point.
    """
    kind = size[0]
    if kind == SUPERQUADRIC:
        if size[4] == size[5]:
            return _even(size[1], size[2], size[3], size[4], x, y, z)
        return _superquadric(size[1], size[2], size[3], size[4], size[5], x, y, z)
    if kind == ELLIPSOID:
        return _even(size[1], size[2], size[3], 2.0, x, y, z)
    k1, k2 = size[1], size[2]
    value = z + 0.5 * (k1 * x * x + k2 * y * y)
    return value, k1 * x, k2 * y, 1.0, k1, k2, 0.0, 0.0, 0.0, 0.0


_ORDINARY = 1e15
"""Sizes between one over this and this need no other unit of length."""


@kernel
def unit_exponent(size: Size, reach: float) -> int:
    """Exponent of the unit of length in which a body of that size is solved; zero for ordinary sizes."""
    if reach * _ORDINARY > 1.0 and reach < _ORDINARY:
        return 0
    return int(frexp(reach)[1])


@kernel
def resized(size: Size, k: int) -> Size:
    """The body in the unit of length 2^k."""
    kind, a, b, c, p, q = size
    return kind, ldexp(a, k), ldexp(b, k), ldexp(c, k), p, q


@kernel
def unscaled_exponent(size: Any, reach: float) -> int:
    """`unit_exponent` of a user's function, whose unit is not known here."""
    return 0


@kernel
def unresized(size: Any, k: int) -> Any:
    """`resized` for a user's function."""
    return size
