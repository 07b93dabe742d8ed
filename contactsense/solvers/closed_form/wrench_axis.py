"""Wrench axis (paper, section 4): the point where the force's line enters a surface, without torsion.

The line is that of the wrench without its moment along the force. These answers have no torsion; that of
the wrench appears in their residual.
"""

from math import sqrt

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.surface.convex_primitives import BOX, REVOLVED
from contactsense.robots.vectors import Vector, add_scaled, cross, divide, dot, norm
from contactsense.solvers.closed_form.cylinder import solve_cone, solve_cylinder
from contactsense.solvers.closed_form.nearest_point import TAPERED, enter
from contactsense.solvers.closed_form.plane import plane_units, solve_plane
from contactsense.solvers.solution import (
    MISS,
    OK,
    SHARP,
    Answer,
    has_point,
    input_status,
    make_answer,
    no_contact,
)
from contactsense.solvers.units import LARGE, SMALL, from_units, in_units, length_to_units, to_units
from contactsense.solvers.wrench import Wrench, pure_force

_SMALLEST, _LARGEST = 1e-30, 1e30
"""Semi-axes between these need no other unit of length."""


@kernel
def _ellipsoid(wrench: Wrench, a: float, b: float, c: float) -> Answer:
    f, m = wrench
    ff = dot(f, f)
    # In units of the semi-axes the ellipsoid is the unit sphere: line r + s u.
    u = (f[0] / a, f[1] / b, f[2] / c)
    w = cross(f, m)
    r = (w[0] / (ff * a), w[1] / (ff * b), w[2] / (ff * c))
    uu = dot(u, u)
    r = add_scaled(r, -(dot(r, u) / uu), u)
    inside = 1.0 - dot(r, r)
    status = OK
    if inside > 0.0:
        x = add_scaled(r, -sqrt(inside / uu), u)
    else:
        status = MISS
        x = divide(r, sqrt(1.0 - inside))
    gradient = (x[0] / a, x[1] / b, x[2] / c)
    n = divide(gradient, norm(gradient))
    return make_answer(status, wrench, (a * x[0], b * x[1], c * x[2]), n, 0.0, 0.0, 0.0)


@kernel
def wrench_axis_ellipsoid(wrench: Wrench, a: float, b: float, c: float) -> Answer:
    """Where the wrench axis enters an ellipsoid about the origin with semi-axes `a`, `b`, `c`.

    That is (5) and (6) of the paper. On a miss the point nearest to the line, in the ellipsoid's own metric.
    """
    f, m = wrench
    ordinary = min(a, b, c) > _SMALLEST and max(a, b, c) < _LARGEST
    if ordinary and SMALL < dot(f, f) < LARGE and dot(m, m) < LARGE:
        return _ellipsoid(wrench, a, b, c)
    status, local, units = in_units(wrench, max(a, b, c))
    if status != OK:
        return no_contact(status)
    a, b, c = length_to_units(a, units), length_to_units(b, units), length_to_units(c, units)
    return from_units(_ellipsoid(local, a, b, c), units)


@kernel
def _without_torsion(answer: Answer, wrench: Wrench) -> Answer:
    """The answer for a pure force on the line, with the residual of the whole wrench."""
    if not has_point(answer):
        return answer
    # Without torsion a corner is as good as any place.
    status = OK if answer.status == SHARP else answer.status
    return make_answer(status, wrench, answer.centroid, answer.normal, 0.0, 0.0, 0.0)


@kernel
def line_answer(answer: Answer, wrench: Wrench, largest_torsion: float) -> Answer:
    """The same for a body with a rim: a contact there that would need a torsion is a miss."""
    if not has_point(answer):
        return no_contact(MISS)
    status = OK if answer.status == OK and abs(answer.torsion) <= largest_torsion else MISS
    return make_answer(status, wrench, answer.centroid, answer.normal, 0.0, 0.0, 0.0)


@kernel
def wrench_axis_cylinder(wrench: Wrench, radius: float) -> Answer:
    """Where the wrench axis enters an infinite cylinder about z."""
    status, local, units = in_units(wrench, radius)
    if status != OK:
        return no_contact(status)
    answer = solve_cylinder(pure_force(local), length_to_units(radius, units))
    return from_units(_without_torsion(answer, local), units)


@kernel
def wrench_axis_cone(wrench: Wrench, radius: float, taper: float) -> Answer:
    """Where the wrench axis enters an endless cone about z."""
    status, local, units = in_units(wrench, radius)
    if status != OK:
        return no_contact(status)
    answer = solve_cone(pure_force(local), length_to_units(radius, units), taper)
    return from_units(_without_torsion(answer, local), units)


@kernel
def wrench_axis_plane(wrench: Wrench, normal: Vector, offset: float) -> Answer:
    """Where the wrench axis meets the plane n.c = offset."""
    status = input_status(wrench)
    if status != OK:
        return no_contact(status)
    units = plane_units(wrench, offset)
    wrench = to_units(wrench, units)
    answer = solve_plane(pure_force(wrench), normal, length_to_units(offset, units))
    return from_units(_without_torsion(answer, wrench), units)


@kernel
def wrench_axis_tapered_capsule(wrench: Wrench, half: float, radius_a: float, radius_b: float) -> Answer:
    """Where the wrench axis enters the convex hull of two balls on z."""
    size = (half, radius_a, radius_b, 0.0)
    return enter(TAPERED, size, half + max(radius_a, radius_b), wrench)


@kernel
def wrench_axis_revolved(wrench: Wrench, half: float, lower: float, upper: float, rounding: float) -> Answer:
    """Where the wrench axis enters a truncated cone about z plus a ball."""
    size = (half, lower, upper, rounding)
    return enter(REVOLVED, size, half + max(lower, upper) + rounding, wrench)


@kernel
def wrench_axis_box(wrench: Wrench, half: Vector, rounding: float) -> Answer:
    """Where the wrench axis enters a box about the origin plus a ball."""
    size = (half[0], half[1], half[2], rounding)
    return enter(BOX, size, half[0] + half[1] + half[2] + rounding, wrench)
