"""Cylinder and cone about z: closed forms.

Both are one surface, of radius R - z tan(beta) at height z. With e the radial direction of the contact, the
moment about the generator through it gives the direction alone, and the moment about the circle's tangent the
height:

    e.p = m_z,      p = (R f_y + tan(beta) m_x, -R f_x + tan(beta) m_y)
    z = (m_theta + R f_z) / (f_rho + tan(beta) f_z)

A steep cone (tan(beta) > 1) is described about its apex, where R = 0: else R and tan(beta) z cancel near it.

For beta = 0 this is the paper's cylinder (section 5.1.2) without its division by the torsion: where the
contact lies around the axis does not depend on it.
"""

from math import sqrt

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import divide, dot, norm
from contactsense.solvers.solution import (
    MISS,
    OK,
    PARALLEL,
    PULLING,
    SHARP,
    TANGENT,
    TINY,
    Answer,
    make_answer,
    no_contact,
    torsion,
)
from contactsense.solvers.units import LARGE, SMALL, from_units, in_units, length_to_units
from contactsense.solvers.wrench import Wrench, about_height, line_point

_AT_APEX = 1e-15
"""Moment about the apex, relative to that about the origin, that is rounding."""


@kernel
def directions(wrench: Wrench, radius: float, taper: float) -> tuple[float, float, float, float, float]:
    """The two radial directions with e.p = m_z are (a, b) + (u, v) and (a, b) - (u, v).

    Returns:
        The discriminant |p|^2 - m_z^2 (no direction exists where it is negative), then a, b, u, v. On a
        cylinder the pushing one is the second.
    """
    f, m = wrench
    px = radius * f[1] + taper * m[0]
    py = taper * m[1] - radius * f[0]
    pp = px * px + py * py
    if pp < TINY:
        return -1.0, 0.0, 0.0, 0.0, 0.0
    disc = pp - m[2] * m[2]
    inverse = 1.0 / pp
    along = m[2] * inverse
    across = sqrt(max(disc, 0.0)) * inverse
    return disc, along * px, along * py, -across * py, across * px


@kernel
def height(wrench: Wrench, ex: float, ey: float, radius: float, taper: float) -> tuple[float, float]:
    """Height of the contact whose radial direction is (ex, ey), and f.n / cos(beta) there."""
    f, m = wrench
    push = ex * f[0] + ey * f[1] + taper * f[2]
    return (ex * m[1] - ey * m[0] + radius * f[2]) / push, push


@kernel
def lateral_frame(wrench: Wrench, radius: float, taper: float, apex: float) -> tuple[Wrench, float, float]:
    """Where the side is described: about the origin, or about the apex if it is steep.

    Args:
        wrench: The wrench about the origin.
        radius, taper: Of the side at the origin.
        apex: Height of the apex; of use if the side is steep.

    Returns:
        The wrench about that point, radius there, and the point's height.
    """
    if abs(taper) <= 1.0:
        return wrench, radius, 0.0
    return about_height(wrench, apex), 0.0, apex


@kernel
def on_lateral(
    status: int, wrench: Wrench, ex: float, ey: float, z: float, rho: float, taper: float
) -> Answer:
    """Answer for a contact at height `z` in the radial direction (ex, ey), `rho` from the axis."""
    cos_beta = 1.0 / sqrt(1.0 + taper * taper)
    n = (cos_beta * ex, cos_beta * ey, cos_beta * taper)
    c = (rho * ex, rho * ey, z)
    xi = torsion(wrench, c, n) if status <= PULLING else 0.0
    return make_answer(status, wrench, c, n, xi, cos_beta / rho, 0.0)


@kernel
def _nearest_height(wrench: Wrench) -> float:
    """Height at which the force's line is nearest to the axis."""
    f = wrench.force
    r = line_point(wrench)
    return r[2] - f[2] * (f[0] * r[0] + f[1] * r[1]) / (f[0] * f[0] + f[1] * f[1])


@kernel
def _cylinder(wrench: Wrench, radius: float) -> Answer:
    f, m = wrench
    if radius * radius * (f[0] * f[0] + f[1] * f[1]) < TINY:
        return no_contact(PARALLEL)
    disc, a, b, u, v = directions(wrench, radius, 0.0)
    if disc > 0.0:
        ex, ey = a - u, b - v
        z = radius * (ex * m[1] - ey * m[0] + radius * f[2]) / -sqrt(disc)
        return on_lateral(OK, wrench, ex, ey, z, radius, 0.0)
    size = sqrt(a * a + b * b)
    status = MISS if disc < 0.0 else TANGENT
    return on_lateral(status, wrench, a / size, b / size, _nearest_height(wrench), radius, 0.0)


@kernel
def solve_cylinder(wrench: Wrench, radius: float) -> Answer:
    """Contact centroid on an infinite cylinder about z (paper, section 5.1.2).

    Args:
        wrench: Wrench on the body.
        radius: Of the cylinder.

    Returns:
        See `contactsense.solvers.solution`. A solution exists for |m_z| < radius |(fx, fy)|.
    """
    f, m = wrench
    pp = radius * radius * (f[0] * f[0] + f[1] * f[1])
    if SMALL < pp < LARGE and dot(m, m) < LARGE and radius * abs(f[2]) < LARGE:
        return _cylinder(wrench, radius)
    status, local, units = in_units(wrench, radius)
    if status != OK:
        return no_contact(status)
    return from_units(_cylinder(local, length_to_units(radius, units)), units)


@kernel
def _at_apex(wrench: Wrench, apex: float, taper: float) -> Answer:
    """Answer at the apex, taken as a ball without radius.

    A moment about it is a torsion there, so it gives the normal, which must be one of the ball's. Without it
    the force must enter the body there, or push against one of these normals.
    """
    f, m = wrench
    moment = about_height(wrench, apex).moment
    ff = dot(f, f)
    up = 1.0 if taper > 0.0 else -1.0
    steep = abs(taper)
    across = sqrt(f[0] * f[0] + f[1] * f[1])
    if dot(moment, moment) <= _AT_APEX * _AT_APEX * (dot(m, m) + apex * apex * ff):
        if not (up * f[2] < 0.0 and (across < -steep * up * f[2] or steep * across < -up * f[2])):
            return no_contact(MISS)
        n, xi = divide(f, -sqrt(ff)), 0.0
    else:
        xi = norm(moment)
        if dot(moment, f) > 0.0:
            xi = -xi
        n = divide(moment, xi)
        if not (steep * sqrt(n[0] * n[0] + n[1] * n[1]) <= up * n[2] and dot(n, f) < 0.0):
            return no_contact(MISS)
    return make_answer(SHARP, wrench, (0.0, 0.0, apex), n, xi, 0.0, 0.0)


@kernel
def _cone(wrench: Wrench, radius: float, taper: float) -> Answer:
    apex = radius / taper
    local, base, below = lateral_frame(wrench, radius, taper, apex)
    disc, a, b, u, v = directions(local, base, taper)
    ex = ey = z = rho = 0.0
    status = MISS
    if disc > 0.0:
        for sign in (-1.0, 1.0):
            ax, ay = a + sign * u, b + sign * v
            at, push = height(local, ax, ay, base, taper)
            # The mirrored cone beyond the apex does not belong to the body.
            if push != 0.0 and base - taper * at > 0.0 and status != OK:
                ex, ey, z, rho = ax, ay, at + below, base - taper * at
                status = OK if push < 0.0 else PULLING
    if status != OK:
        answer = _at_apex(wrench, apex, taper)
        if answer.status == SHARP or status == MISS:
            return answer
    return on_lateral(status, wrench, ex, ey, z, rho, taper)


@kernel
def solve_cone(wrench: Wrench, radius: float, taper: float) -> Answer:
    """Contact centroid on the endless cone of radius `radius` - `taper` z about z, up to its apex.

    Args:
        wrench: Wrench on the body.
        radius: At z = 0, positive.
        taper: Tangent of the angle between side and axis, not zero.

    Returns:
        See `contactsense.solvers.solution`; `SHARP` where the wrench acts on the apex. A miss has no nearest
        point.
    """
    f, m = wrench
    ff = dot(f, f)
    if radius * radius * ff > SMALL and (1.0 + radius * radius) * ff < LARGE and dot(m, m) < LARGE:
        return _cone(wrench, radius, taper)
    status, local, units = in_units(wrench, radius)
    if status != OK:
        return no_contact(status)
    return from_units(_cone(local, length_to_units(radius, units), taper), units)
