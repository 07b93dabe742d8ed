"""Iteration on any smooth convex body: the closed-form contact on the osculating ellipsoid.

Divided by the body's extent (x = (c - inner) / extent) a wrench is u, v as on the unit sphere
(`contactsense.solvers.closed_form.ellipsoid`). Let N be the body's gauge about the inner point, homogeneous
of degree one and 1 on the surface. At any x the quadratic form Q = hess (N^2 / 2) is that of an ellipsoid
about the inner point that has the surface's gradient and curvature there. Its contact obeys
v = K Q x + x x u, so with D^2 = det Q

    (K D)^2 - l^2 = v . adj(Q) v - u . Q u,      K l = -u . v,      l = -u . Q x

    x = (K adj(Q) v + (Q u) x v - l u) / ((K D)^2 + u . Q u)

and both K D and l come from the branch that adds. The ray through it meets the surface at the next x. On an
ellipsoid the first step ends; near the contact on any body the steps converge quadratically, and far from it
they know that a body has another side, which Newton's linear ones do not.
"""

from math import inf, sqrt
from typing import NamedTuple

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector, add, add_scaled, cross, dot, scale, subtract
from contactsense.solvers.general_convex.initial_guess import initial_guess, warped_step
from contactsense.solvers.general_convex.level_set import (
    SmoothBody,
    Symmetric,
    level_at,
    symmetric_scaled,
    symmetric_times,
    tangential_at,
    tangential_step,
)
from contactsense.solvers.general_convex.newton import Iterate
from contactsense.solvers.solution import is_contact
from contactsense.solvers.wrench import Wrench, invariant, moment_about

_STEPS = 12
"""Beyond these it is quicker to search carefully."""

_BENDS = 5
"""Steps that follow the body's own bend; later ones are Newton's, which converge quadratically."""

_ON = 1e-9
"""How far beside the surface, relative to its distance, the square no longer counts."""


class Gauge(NamedTuple):
    """A body's gauge on a ray from its inner point, in units of its extent."""

    there: bool
    """Whether the ray meets the surface."""
    point: Vector
    """Where it does."""
    gradient: Vector
    q: Symmetric
    """Hessian of half the gauge's square."""
    off: float
    """How far beside the surface the function was taken."""


@kernel
def _adjugate(q: Symmetric) -> Symmetric:
    xx, yy, zz, xy, xz, yz = q
    return (
        yy * zz - yz * yz,
        xx * zz - xz * xz,
        xx * yy - xy * xy,
        xz * yz - xy * zz,
        xy * yz - xz * yy,
        xy * xz - xx * yz,
    )


@kernel
def _by_components(a: Vector, b: Vector) -> Vector:
    return a[0] * b[0], a[1] * b[1], a[2] * b[2]


@kernel
def _stretched(h: Symmetric, a: Vector) -> Symmetric:
    """D H D with the diagonal D."""
    x, y, z = a
    return x * x * h[0], y * y * h[1], z * z * h[2], x * y * h[3], x * z * h[4], y * z * h[5]


@kernel
def _outer(a: Vector, b: Vector) -> Symmetric:
    """Symmetric part of the outer product."""
    return (
        a[0] * b[0],
        a[1] * b[1],
        a[2] * b[2],
        0.5 * (a[0] * b[1] + a[1] * b[0]),
        0.5 * (a[0] * b[2] + a[2] * b[0]),
        0.5 * (a[1] * b[2] + a[2] * b[1]),
    )


@kernel
def _sum(a: Symmetric, b: Symmetric) -> Symmetric:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@kernel
def osculate(q: Symmetric, u: Vector, v: Vector) -> tuple[bool, Vector]:
    """Contact of the wrench (u, v) on the ellipsoid x . Q x = 1, up to its size: whether there is one, and
    x."""
    a = _adjugate(q)
    det = max(q[0] * a[0] + q[3] * a[3] + q[4] * a[4], 0.0)
    p, w = symmetric_times(q, u), symmetric_times(a, v)
    uu = dot(u, p)
    tau = dot(u, v)
    square = det * tau * tau
    sigma = dot(v, w) - uu
    large = 0.5 * (sqrt(sigma * sigma + 4.0 * square) + abs(sigma))
    share = 1.0 / large
    if sigma < 0.0:
        ll, kk = large, square * share
        l = sqrt(ll)  # noqa: E741
        across = -tau * l * share
    elif square > 0.0:
        ll, kk = square * share, large
        l = sqrt(ll)  # noqa: E741
        across = -tau / l
    else:
        return False, (0.0, 0.0, 0.0)
    x = add_scaled(add(scale(across, w), cross(p, v)), -l, u)
    return True, scale(1.0 / (kk + uu), x)


@kernel
def gauge_at(body: SmoothBody, x: Vector) -> Gauge:
    """The body's gauge on the ray through x, in units of its extent about the inner point.

    A function that is not a gauge is followed to the surface by its second order. Its level set has the
    gauge's gradient g / (g . x), and the Hessian there is its own, pulled back along the ray.
    """
    level = level_at(body.size, add(body.inner, _by_components(body.extent, x)))
    g, h = _by_components(body.extent, level.gradient), _stretched(level.hessian, body.extent)
    if body.gauge:
        s = 1.0 + level.value
        return Gauge(s > 0.0, scale(1.0 / s, x), g, _sum(_outer(g, g), symmetric_scaled(s, h)), 0.0)
    k = symmetric_times(h, x)
    rise, curl = dot(g, x), dot(k, x)
    root = rise * rise - 2.0 * level.value * curl
    e = min(max(-2.0 * level.value / (rise + sqrt(root)), -0.9), 20.0) if root > 0.0 else 0.0
    s = 1.0 + e
    x, g = scale(s, x), add_scaled(g, e, k)
    i = 1.0 / dot(g, x)
    g, k = scale(i, g), scale(i * s, k)
    w = 1.0 + dot(k, x)
    q = _sum(
        symmetric_scaled(i, h), _sum(symmetric_scaled(-2.0, _outer(k, g)), symmetric_scaled(w, _outer(g, g)))
    )
    return Gauge(root > 0.0 and 0.0 < i < inf, x, g, q, abs(e))


@kernel
def _polished(wrench: Wrench, body: SmoothBody, gauge: Gauge, steps: int) -> Iterate:
    """The contact near a converged iterate, by one Newton step: rounding errors of Q, which grow with the
    exponent, do not enter it."""
    f = wrench.force
    a, b, c = body.extent
    inverse = (1.0 / a, 1.0 / b, 1.0 / c)
    point = add(body.inner, _by_components(body.extent, gauge.point))
    # Along the tangents Q is the gauge's own Hessian.
    at = tangential_at(wrench, point, _by_components(inverse, gauge.gradient), _stretched(gauge.q, inverse))
    t = invariant(wrench)
    det = at.w11 * at.w22 - at.w12 * at.w12
    found = is_contact(t, at.xi, at.push, det)
    n, xi, push = at.normal, at.xi, at.push
    va, vb = tangential_step(at)
    wa, wb = at.w11 * va + at.w12 * vb, at.w12 * va + at.w22 * vb
    trial = add_scaled(add_scaled(point, va, at.t1), vb, at.t2)
    turned = add_scaled(add_scaled(n, wa, at.t1), wb, at.t2)
    r = moment_about(wrench, trial)
    left = cross(turned, r)
    if dot(left, left) < at.f1 * at.f1 + at.f2 * at.f2:
        point, n = trial, turned
        xi, push = dot(turned, r), dot(turned, f)
    if push * push > 1e-3 * dot(f, f):
        xi = t / push
    return Iterate(found, steps, point, n, xi, at.w11 + at.w22, det)


@kernel
def osculating_iteration(body: SmoothBody, wrench: Wrench) -> Iterate:
    """Iterate over osculating ellipsoids; the last point if it did not converge.

    There is no safeguard: if it does not converge within a few steps, `newton_iteration` is used.
    """
    f, m = wrench
    a, b, c = body.extent
    local = moment_about(wrench, body.inner)
    u, v = (b * c * f[0], c * a * f[1], a * b * f[2]), _by_components(body.extent, local)
    tau = abs(dot(u, v))
    # Rounding error of the moment, squared.
    i = body.inner
    rounding = (
        a * (abs(m[0]) + abs(i[1] * f[2]) + abs(i[2] * f[1])),
        b * (abs(m[1]) + abs(i[2] * f[0]) + abs(i[0] * f[2])),
        c * (abs(m[2]) + abs(i[0] * f[1]) + abs(i[1] * f[0])),
    )
    tolerance = 16e-32 * (dot(rounding, rounding) + 4.0 * dot(u, u))
    x = initial_guess(body.size, Wrench(u, v))
    previous = inf
    step = 0
    while True:
        gauge = gauge_at(body, x)
        x = gauge.point
        if not gauge.there:
            break
        g = gauge.gradient
        # Tangential moment, times the norm of the gradient.
        left = cross(subtract(v, cross(x, u)), g)
        squared_residual = dot(left, left)
        limit = tolerance * dot(g, g)
        converged = squared_residual <= limit or (
            squared_residual <= 1e4 * limit and squared_residual > 0.25 * previous
        )
        if dot(u, g) < 0.0 and gauge.off < _ON and converged:
            return _polished(wrench, body, gauge, step)
        if step == _STEPS:
            break
        previous = squared_residual
        there, new = osculate(gauge.q, u, v)
        if not there:
            break
        step += 1
        bent = step <= _BENDS
        x = warped_step(body.size, tau, u, x, new, symmetric_times(gauge.q, new)) if bent else new
    return Iterate(
        False, step, add(body.inner, _by_components(body.extent, x)), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0
    )
