"""Ellipsoid method: encloses the contact in shrinking ellipses; slow, but guaranteed to converge.

Seen along the force, the pushed side of the body is the graph of a concave height h over its shadow, and
the contact obeys G(q) = p grad h(q) + J (q - q0) = 0 there (`contactsense.solvers.newton`). J is skew and
h concave, so -sign(p) G is monotone: a line through any q of the shadow, perpendicular to G(q), has the
contact on one known side. Outside the shadow, a tangent of the shadow does the same. The smallest ellipse
around the remaining half has 0.77 of the area, however flat or steep the body is.
"""

from math import sqrt
from typing import Any

from contactsense.solvers.implicit_surfaces import evaluate
from contactsense.solvers.level_set import Point, enter_level, tangents
from contactsense.solvers.solution import OK
from contactsense.solvers.typed_kernel import kernel

_MAX_CUTS = 300
"""Maximum number of cuts: 0.77^300 = 1e-34, an ellipse as small as rounding errors."""


@kernel
def bracket_contact(
    size: Any,
    inner: Point,
    reach: float,
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
) -> tuple[int, float, float, float]:
    """Enclose the contact of a wrench with torsion.

    Args:
        size: The body.
        inner: A point well inside.
        reach: Its size.
        fx, fy, fz, mx, my, mz: Wrench.

    Returns:
        Number of cuts, and a start for `newton_iteration`.
    """
    ff = fx * fx + fy * fy + fz * fz
    force = sqrt(ff)
    ax, ay, az, bx, by, bz = tangents(-fx / force, -fy / force, -fz / force)
    pitch = (fx * mx + fy * my + fz * mz) / ff
    side = -1.0 if pitch > 0.0 else 1.0
    # The force's line, from the inner point.
    ox, oy, oz = (
        (fy * mz - fz * my) / ff - inner[0],
        (fz * mx - fx * mz) / ff - inner[1],
        (fx * my - fy * mx) / ff - inner[2],
    )
    oa, ob = ax * ox + ay * oy + az * oz, bx * ox + by * oy + bz * oz
    qa = qb = pab = 0.0
    paa = pbb = 16.0 * reach * reach
    x, y, z = inner
    for cut in range(_MAX_CUTS):
        px, py, pz = inner[0] + qa * ax + qb * bx, inner[1] + qa * ay + qb * by, inner[2] + qa * az + qb * bz
        entered, px, py, pz = enter_level(
            size, inner, reach, fx, fy, fz, py * fz - pz * fy, pz * fx - px * fz, px * fy - py * fx
        )
        level = evaluate(size, px, py, pz)
        ga = level[1] * ax + level[2] * ay + level[3] * az
        gb = level[1] * bx + level[2] * by + level[3] * bz
        if entered == OK:
            x, y, z = px, py, pz
            rise = -(level[1] * fx + level[2] * fy + level[3] * fz) / force
            ga, gb = (
                side * (-pitch * ga - rise * (qb - ob)),
                side * (-pitch * gb + rise * (qa - oa)),
            )
        wa, wb = paa * ga + pab * gb, pab * ga + pbb * gb
        width = sqrt(max(ga * wa + gb * wb, 0.0))
        if not width > 1e-16 * reach * sqrt(ga * ga + gb * gb):
            return cut, x, y, z
        wa, wb = wa / width, wb / width
        qa, qb = qa - wa / 3.0, qb - wb / 3.0
        paa = 4.0 / 3.0 * (paa - 2.0 / 3.0 * wa * wa)
        pab = 4.0 / 3.0 * (pab - 2.0 / 3.0 * wa * wb)
        pbb = 4.0 / 3.0 * (pbb - 2.0 / 3.0 * wb * wb)
    return _MAX_CUTS, x, y, z
