"""Geometry of a convex level set: where lines enter it, and the quantities of Newton's method at a point."""

from math import sqrt
from typing import Any, NamedTuple

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector, add, add_scaled, divide, dot, norm, scale, subtract, tangents
from contactsense.solvers.general_convex.implicit_surfaces import evaluate
from contactsense.solvers.solution import MISS, OK
from contactsense.solvers.units import scale_by_power
from contactsense.solvers.wrench import Wrench, line_point, moment_about

_RETRACTIONS = 60
_NEAR = 1e-2
"""Relative to the body's size: from here a point may fall onto the surface towards the inner point."""

Symmetric = tuple[float, float, float, float, float, float]
"""Symmetric matrix: xx, yy, zz, xy, xz, yz."""


class SmoothBody(NamedTuple):
    """A smooth convex body, given by a function."""

    size: Any
    """What the function takes before the point; for the packaged bodies see
    `contactsense.solvers.general_convex.implicit_surfaces.evaluate`."""
    inner: Vector
    """A point well inside."""
    extent: Vector
    """Half the body's size along each axis, about."""
    gauge: bool
    """Whether the function plus one is homogeneous of degree one about the inner point."""


class Level(NamedTuple):
    """A body's function at a point."""

    value: float
    gradient: Vector
    hessian: Symmetric


class SurfacePoint(NamedTuple):
    """Where a line meets a body, with the body's function there."""

    there: bool
    """Whether it does."""
    point: Vector
    gradient: Vector
    hessian: Symmetric


class Tangential(NamedTuple):
    """Quantities of a Newton step at a surface point, see `contactsense.solvers.general_convex.newton`."""

    normal: Vector
    t1: Vector
    """Tangents, t1 x t2 = n."""
    t2: Vector
    f1: float
    """Tangential moment F along t1."""
    f2: float
    """The same along t2."""
    w11: float
    """Shape operator in these tangents."""
    w12: float
    w22: float
    xi: float
    """Torsion."""
    push: float
    """f.n."""


@kernel
def symmetric_times(h: Symmetric, a: Vector) -> Vector:
    """Product of a symmetric matrix and a vector."""
    xx, yy, zz, xy, xz, yz = h
    return (
        xx * a[0] + xy * a[1] + xz * a[2],
        xy * a[0] + yy * a[1] + yz * a[2],
        xz * a[0] + yz * a[1] + zz * a[2],
    )


@kernel
def symmetric_scaled(factor: float, h: Symmetric) -> Symmetric:
    """Multiple of a symmetric matrix."""
    return factor * h[0], factor * h[1], factor * h[2], factor * h[3], factor * h[4], factor * h[5]


@kernel
def level_at(size: Any, point: Vector) -> Level:
    """Value, gradient and Hessian of the body's function."""
    value, gx, gy, gz, xx, yy, zz, xy, xz, yz = evaluate(size, point[0], point[1], point[2])
    return Level(value, (gx, gy, gz), (xx, yy, zz, xy, xz, yz))


@kernel
def reach_of(body: SmoothBody) -> float:
    """Size of a body."""
    return max(body.extent[0], body.extent[1], body.extent[2])


@kernel
def body_in_unit(body: SmoothBody, size: Any, k: int) -> SmoothBody:
    """A body in the unit of length 2^k, in which its function takes `size`."""
    return SmoothBody(size, scale_by_power(body.inner, -k), scale_by_power(body.extent, -k), body.gauge)


@kernel
def line_entry(body: SmoothBody, f: Vector, start: Vector) -> SurfacePoint:
    """Where the line through a point along the force enters the body.

    The moment m - c x f does not change along the force, so steps that end here are exact in it. The function
    is convex on the line: Newton's method from outside does not pass the root, and with the second derivative
    it also comes quickly to where the line grazes.
    """
    reach = reach_of(body)
    x, d = start, divide(f, norm(f))
    level = level_at(body.size, x)
    slope = dot(level.gradient, d)
    careful = False
    if slope >= 0.0:
        # Past the closest point: start outside.
        x = add_scaled(x, -(dot(x, d) + 4.0 * reach), d)
        level = level_at(body.size, x)
        slope = dot(level.gradient, d)
    hit = False
    for _ in range(_RETRACTIONS):
        if slope >= 0.0:
            break
        value, fall = level.value, slope
        bend = dot(d, symmetric_times(level.hessian, d))
        if body.gauge:
            # For half the square of a gauge this is exact on an ellipsoid.
            bend = fall * fall + (1.0 + value) * bend
            fall *= 1.0 + value
            value *= 1.0 + 0.5 * value
        root = fall * fall - 2.0 * value * bend
        step = 2.0 * value / (sqrt(root) - fall) if root > 0.0 and not careful else -value / fall
        before = x
        x = add_scaled(x, step, d)
        level = level_at(body.size, x)
        slope = dot(level.gradient, d)
        if slope >= 0.0 and not careful:
            # Overshoot of the second-order step.
            careful = True
            x = before
            level = level_at(body.size, x)
            slope = dot(level.gradient, d)
        elif body.gauge and abs(step) <= _NEAR * reach:
            # Close to the surface: project towards the inner point, at no cost.
            return _on_ray(body.inner, x, level)
        elif abs(step) <= 1e-9 * reach:
            hit = True
            break
    return SurfacePoint(hit, x, level.gradient, level.hessian)


@kernel
def _on_ray(inner: Vector, x: Vector, level: Level) -> SurfacePoint:
    """Surface point on the ray from the inner point through x, where the gauge is `level`.

    The gradient of a gauge is constant along the ray, and its Hessian scales.
    """
    s = 1.0 + level.value
    point = add(inner, divide(subtract(x, inner), s))
    return SurfacePoint(True, point, level.gradient, symmetric_scaled(s, level.hessian))


@kernel
def ray_entry(body: SmoothBody, x: Vector) -> SurfacePoint:
    """Surface point on the ray from the inner point through x; there is always one."""
    inner = body.inner
    d = subtract(x, inner)
    level = level_at(body.size, x)
    if body.gauge:
        return _on_ray(inner, x, level)
    share = 1.0
    for _ in range(_RETRACTIONS):
        slope = dot(level.gradient, d)
        if slope <= 0.0:
            # Too close to the inner point: start further out.
            share *= 2.0
            step = 1.0
        else:
            step = level.value / slope
            share -= step
        x = add_scaled(inner, share, d)
        level = level_at(body.size, x)
        if abs(step) <= 1e-9 * share:
            break
    return SurfacePoint(True, x, level.gradient, level.hessian)


@kernel
def tangential_at(wrench: Wrench, c: Vector, gradient: Vector, hessian: Symmetric) -> Tangential:
    """Quantities of a Newton step at a surface point, from gradient and Hessian there."""
    slope = norm(gradient)
    inverse = 1.0 / slope if slope > 0.0 else 0.0
    n = scale(inverse, gradient)
    t1, t2 = tangents(n)
    h1, h2 = symmetric_times(hessian, t1), symmetric_times(hessian, t2)
    r = moment_about(wrench, c)
    return Tangential(
        n,
        t1,
        t2,
        dot(t1, r),
        dot(t2, r),
        dot(t1, h1) * inverse,
        dot(t1, h2) * inverse,
        dot(t2, h2) * inverse,
        dot(n, r),
        dot(n, wrench.force),
    )


@kernel
def tangential_step(at: Tangential) -> tuple[float, float]:
    """Newton's step in the tangent plane, along t1 and t2: M v = -F with M = fn J - xi W."""
    xi, push = at.xi, at.push
    det = push * push + xi * xi * (at.w11 * at.w22 - at.w12 * at.w12)
    return (
        (xi * at.w22 * at.f1 - (push + xi * at.w12) * at.f2) / det,
        (xi * at.w11 * at.f2 + (push - xi * at.w12) * at.f1) / det,
    )


@kernel
def enter_level(body: SmoothBody, wrench: Wrench) -> tuple[int, Vector]:
    """Point where the force's line enters the body; on a miss the point of the line with the lowest
    value."""
    f = wrench.force
    ff = dot(f, f)
    p = line_point(wrench)
    middle = dot(subtract(body.inner, p), f) / ff
    half = 4.0 * reach_of(body) / sqrt(ff)
    at = middle - half
    for _ in range(_RETRACTIONS):
        level = level_at(body.size, add_scaled(p, at, f))
        slope = dot(level.gradient, f)
        if slope >= 0.0:
            break
        step = -level.value / slope
        at += step
        if step <= 4e-16 * (half + abs(at)):
            return OK, add_scaled(p, at, f)
    low, high = middle - half, middle + half
    for _ in range(_RETRACTIONS):
        at = 0.5 * (low + high)
        if dot(level_at(body.size, add_scaled(p, at, f)).gradient, f) > 0.0:
            high = at
        else:
            low = at
    return MISS, add_scaled(p, at, f)
