"""Plane: closed form (paper, section 5.1.3, with the signs of a pushing contact)."""

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector, add_scaled, cross, divide, dot
from contactsense.solvers.solution import (
    OK,
    PARALLEL,
    PULLING,
    Answer,
    input_status,
    make_answer,
    no_contact,
    torsion,
)
from contactsense.solvers.units import LARGE, SMALL, Units, exponent, from_units, length_to_units, to_units
from contactsense.solvers.wrench import Wrench


@kernel
def _plane(wrench: Wrench, n: Vector, offset: float) -> Answer:
    f, m = wrench
    push = dot(n, f)
    if push == 0.0:
        return no_contact(PARALLEL)
    c = divide(add_scaled(cross(n, m), offset, f), push)
    status = OK if push < 0.0 else PULLING
    return make_answer(status, wrench, c, n, torsion(wrench, c, n), 0.0, 0.0)


@kernel
def plane_units(wrench: Wrench, offset: float) -> Units:
    """Units in which force, offset and lever are of order one."""
    f, m = wrench
    e = exponent(max(abs(f[0]), abs(f[1]), abs(f[2])))
    moment = max(abs(m[0]), abs(m[1]), abs(m[2]))
    k = exponent(offset) if offset != 0.0 else -2000
    if moment > 0.0:
        k = max(k, exponent(moment) - e)
    return Units(e, e, k if k > -2000 else 0)


@kernel
def solve_plane(wrench: Wrench, normal: Vector, offset: float) -> Answer:
    """Contact centroid on the plane n.c = offset, the body on its inner side: c = (n x m + offset f) / (n.f).

    Args:
        wrench: Wrench on the body.
        normal: Outward unit normal.
        offset: Distance of the plane from the origin along the normal.

    Returns:
        See `contactsense.solvers.solution`.
    """
    f, m = wrench
    if SMALL < dot(f, f) < LARGE and dot(m, m) < LARGE:
        return _plane(wrench, normal, offset)
    status = input_status(wrench)
    if status != OK:
        return no_contact(status)
    units = plane_units(wrench, offset)
    return from_units(_plane(to_units(wrench, units), normal, length_to_units(offset, units)), units)
