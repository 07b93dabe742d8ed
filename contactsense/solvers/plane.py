"""Plane: closed form (paper, section 5.1.3, with the signs of a pushing contact)."""

from math import frexp, ldexp

from contactsense.solvers.solution import (
    LARGE,
    OK,
    PARALLEL,
    PULLING,
    SMALL,
    Answer,
    input_status,
    make_answer,
    no_contact,
    rescaled,
    scaled,
    torsion,
)
from contactsense.solvers.typed_kernel import kernel


@kernel
def _plane(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    nx: float,
    ny: float,
    nz: float,
    offset: float,
) -> Answer:
    push = nx * fx + ny * fy + nz * fz
    if push == 0.0:
        return no_contact(PARALLEL)
    cx = (ny * mz - nz * my + offset * fx) / push
    cy = (nz * mx - nx * mz + offset * fy) / push
    cz = (nx * my - ny * mx + offset * fz) / push
    xi = torsion(fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz)
    status = OK if push < 0.0 else PULLING
    return make_answer(status, fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz, xi, 0.0, 0.0)


@kernel
def plane_exponent(mx: float, my: float, mz: float, offset: float, e: int) -> int:
    """Exponent k of a unit of length 2^k for which offset and lever are of order one, for a force of order
    2^e."""
    moment = max(abs(mx), abs(my), abs(mz))
    k = frexp(offset)[1] if offset != 0.0 else -2000
    if moment > 0.0:
        k = max(k, frexp(moment)[1] - e)
    return k if k > -2000 else 0


@kernel
def solve_plane(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    nx: float,
    ny: float,
    nz: float,
    offset: float,
) -> Answer:
    """Contact centroid on the plane n.c = offset, the body on its inner side: c = (n x m + offset f) / (n.f).

    Args:
        fx, fy, fz, mx, my, mz: Wrench on the body.
        nx, ny, nz: Outward unit normal.
        offset: Distance of the plane from the origin along the normal.

    Returns:
        See `contactsense.solvers.solution`.
    """
    ff = fx * fx + fy * fy + fz * fz
    mm = mx * mx + my * my + mz * mz
    if SMALL < ff < LARGE and mm < LARGE:
        return _plane(fx, fy, fz, mx, my, mz, nx, ny, nz, offset)
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    e = frexp(max(abs(fx), abs(fy), abs(fz)))[1]
    k = plane_exponent(mx, my, mz, offset, e)
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, e, k)
    return rescaled(_plane(fx, fy, fz, mx, my, mz, nx, ny, nz, ldexp(offset, -k)), e, e, k)
