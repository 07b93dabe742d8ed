"""Newton's method on any smooth convex body: two unknowns in the tangent plane.

At a surface point c, with the moment r = m - c x f about it, the tangential part F = T^T r must vanish. A
step T v changes it by M v, M = fn J - xi W, whose determinant fn^2 + xi^2 det W is positive wherever the
force pushes: flat or curved, with or without torsion. So a line search on |F| has no local minima. It may
end at the rim of the pushed side, or slow down where M is nearly singular.
"""

from typing import NamedTuple

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector, add, add_scaled, divide, dot, norm, scale, subtract, tangents
from contactsense.solvers.general_convex.level_set import (
    SmoothBody,
    SurfacePoint,
    line_entry,
    ray_entry,
    reach_of,
    symmetric_times,
    tangential_at,
    tangential_step,
)
from contactsense.solvers.solution import is_contact
from contactsense.solvers.wrench import Wrench, invariant, line_point

_STEPS = 40
_HALVINGS = 12
_FIRST_HALVINGS = 5
_MIN_PUSH = 0.5
"""Cosine between force and inward normal from which on the slopes are the better unknowns."""


class Iterate(NamedTuple):
    """Where an iteration ended."""

    converged: bool
    steps: int
    point: Vector
    normal: Vector
    xi: float
    """Torsion."""
    trace: float
    """Of the shape operator."""
    det: float
    """Its determinant."""


@kernel
def slope_step(wrench: Wrench, at: SurfacePoint) -> Vector:
    """Newton's step for the slopes, in the tangent plane.

    Seen along the force, the pushed side is the graph of a concave height h over the plane square to it. With
    the line of the force through q0 and its pitch p = f.m / |f|^2 the contact over q obeys

        p grad h + J (q - q0) = 0,      J a quarter turn,

    a monotone equation whose Jacobian p hess h + J has a determinant of at least one. Without torsion it is
    linear.
    """
    f, m = wrench
    u = divide(f, -norm(f))
    a, b = tangents(u)
    pitch = dot(f, m) / dot(f, f)
    offset = subtract(at.point, line_point(wrench))
    g = at.gradient
    rise = dot(g, u)
    ha, hb = -dot(g, a) / rise, -dot(g, b) / rise
    # Directions along the graph.
    p, q = add_scaled(a, ha, u), add_scaled(b, hb, u)
    k, l = symmetric_times(at.hessian, p), symmetric_times(at.hessian, q)  # noqa: E741
    factor = -pitch / rise
    aa, ab, bb = factor * dot(p, k), factor * dot(q, k), factor * dot(q, l)
    first = pitch * ha - dot(offset, b)
    second = pitch * hb + dot(offset, a)
    det = 1.0 + aa * bb - ab * ab
    va = -(bb * first - (ab - 1.0) * second) / det
    vb = -(aa * second - (ab + 1.0) * first) / det
    return add(scale(va, p), scale(vb, q))


@kernel
def newton_iteration(body: SmoothBody, lever: float, wrench: Wrench, start: Vector) -> Iterate:
    """Newton's method from the point where the line through a point along the force enters the body.

    If the force pushes well, the step is that of the slopes, and ends along the force. If it grazes, or
    if that step fails, the step is in the tangent plane, and ends towards the inner point. Either must
    reduce |F|.

    Args:
        body: The body.
        lever: Bound of its distance from the origin.
        wrench: Wrench on the body.
        start: Start of the iteration.
    """
    f, m = wrench
    place = line_entry(body, f, start)
    at = tangential_at(wrench, place.point, place.gradient, place.hessian)
    force = norm(f)
    # Rounding error of the moment.
    floor = 4e-16 * (norm(m) + lever * force)
    tolerance = floor * floor
    squared_residual = at.f1 * at.f1 + at.f2 * at.f2
    step = 0
    improved = place.there and at.push < 0.0
    while improved and step < _STEPS and squared_residual > tolerance:
        step += 1
        improved = False
        pushes_well = at.push < -_MIN_PUSH * force
        for attempt in range(2):
            slopes = pushes_well == (attempt == 0)
            if slopes:
                d = slope_step(wrench, place)
            else:
                va, vb = tangential_step(at)
                d = add(scale(va, at.t1), scale(vb, at.t2))
            share = min(1.0, 2.0 * reach_of(body) / norm(d))
            for _ in range(_HALVINGS if attempt == 1 else _FIRST_HALVINGS):
                x = add_scaled(place.point, share, d)
                share *= 0.5
                new = line_entry(body, f, x) if slopes else ray_entry(body, x)
                if new.there:
                    trial = tangential_at(wrench, new.point, new.gradient, new.hessian)
                    new_squared_residual = trial.f1 * trial.f1 + trial.f2 * trial.f2
                    if trial.push < 0.0 and new_squared_residual < squared_residual:
                        improved = True
                        place, at, squared_residual = new, trial, new_squared_residual
                        break
            if improved:
                break
    t = invariant(wrench)
    det = at.w11 * at.w22 - at.w12 * at.w12
    converged = place.there and squared_residual <= 1e4 * tolerance and is_contact(t, at.xi, at.push, det)
    xi = t / at.push if at.push * at.push > 1e-3 * force * force else at.xi
    return Iterate(converged, step, place.point, at.normal, xi, at.w11 + at.w22, det)
