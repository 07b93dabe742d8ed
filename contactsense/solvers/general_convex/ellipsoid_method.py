"""Ellipsoid method: encloses the contact in shrinking ellipses; slow, but guaranteed to converge.

Seen along the force, the pushed side of the body is the graph of a concave height h over its shadow, and the
contact obeys G(q) = p grad h(q) + J (q - q0) = 0 there (`contactsense.solvers.general_convex.newton`). J is
skew and h concave, so -sign(p) G is monotone: a line through any q of the shadow, perpendicular to G(q), has
the contact on one known side. Outside the shadow, a tangent of the shadow does the same. The smallest ellipse
around the remaining half has 0.77 of the area, however flat or steep the body is.
"""

from math import sqrt

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector, add_scaled, cross, divide, dot, subtract, tangents
from contactsense.solvers.general_convex.level_set import SmoothBody, enter_level, level_at, reach_of
from contactsense.solvers.solution import OK
from contactsense.solvers.wrench import Wrench, line_point

_MAX_CUTS = 300
"""Maximum number of cuts: 0.77^300 = 1e-34, an ellipse as small as rounding errors."""


@kernel
def bracket_contact(body: SmoothBody, wrench: Wrench) -> tuple[int, Vector]:
    """Enclose the contact of a wrench with torsion.

    Returns:
        Number of cuts, and a start for `newton_iteration`.
    """
    f, m = wrench
    inner, reach = body.inner, reach_of(body)
    ff = dot(f, f)
    force = sqrt(ff)
    a, b = tangents(divide(f, -force))
    pitch = dot(f, m) / ff
    side = -1.0 if pitch > 0.0 else 1.0
    # The force's line, from the inner point.
    line = subtract(line_point(wrench), inner)
    oa, ob = dot(a, line), dot(b, line)
    qa = qb = pab = 0.0
    paa = pbb = 16.0 * reach * reach
    x = inner
    for cut in range(_MAX_CUTS):
        q = add_scaled(add_scaled(inner, qa, a), qb, b)
        entered, p = enter_level(body, Wrench(f, cross(q, f)))
        g = level_at(body.size, p).gradient
        ga, gb = dot(g, a), dot(g, b)
        if entered == OK:
            x = p
            rise = -dot(g, f) / force
            ga, gb = (
                side * (-pitch * ga - rise * (qb - ob)),
                side * (-pitch * gb + rise * (qa - oa)),
            )
        wa, wb = paa * ga + pab * gb, pab * ga + pbb * gb
        width = sqrt(max(ga * wa + gb * wb, 0.0))
        if not width > 1e-16 * reach * sqrt(ga * ga + gb * gb):
            return cut, x
        wa, wb = wa / width, wb / width
        qa, qb = qa - wa / 3.0, qb - wb / 3.0
        paa = 4.0 / 3.0 * (paa - 2.0 / 3.0 * wa * wa)
        pab = 4.0 / 3.0 * (pab - 2.0 / 3.0 * wa * wb)
        pbb = 4.0 / 3.0 * (pbb - 2.0 / 3.0 * wb * wb)
    return _MAX_CUTS, x
