"""The paper's fingertip (figure 5): a hemisphere on a cylinder of the same radius, open below."""

from math import ldexp

from contactsense.solvers.capsule import ball
from contactsense.solvers.cylinder import directions, height, on_lateral
from contactsense.solvers.solution import (
    LARGE,
    MISS,
    OK,
    SMALL,
    Answer,
    input_status,
    make_answer,
    no_contact,
    rescaled,
    scaled,
    unit_exponents,
)
from contactsense.solvers.typed_kernel import kernel

_PATCH_TOLERANCE = 1e-9
"""Tolerance of a contact outside its patch, relative to the radius, for rounding errors."""


@kernel
def _fingertip(fx: float, fy: float, fz: float, mx: float, my: float, mz: float, radius: float) -> Answer:
    over = 1e300
    ex = ey = z = 0.0
    disc, a, b, u, v = directions(fx, fy, mx, my, mz, radius, 0.0)
    if disc > 0.0:
        ex, ey = a - u, b - v
        z, _ = height(fx, fy, fz, mx, my, ex, ey, radius, 0.0)
        over = z
        if over <= 0.0:
            return on_lateral(OK, fx, fy, fz, mx, my, mz, ex, ey, z, radius, 0.0)
    status, nx, ny, nz, xi = ball(fx, fy, fz, mx, my, mz, 0.0, radius)
    below = -nz * radius if status == OK else 1e300
    if min(over, below) > _PATCH_TOLERANCE * radius:
        return no_contact(MISS)
    if over < below:
        return on_lateral(OK, fx, fy, fz, mx, my, mz, ex, ey, z, radius, 0.0)
    bend = 1.0 / radius
    cx, cy, cz = radius * nx, radius * ny, radius * nz
    return make_answer(OK, fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz, xi, 2.0 * bend, bend * bend)


@kernel
def solve_fingertip(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, radius: float
) -> Answer:
    """Contact centroid on the hemisphere z > 0 about the origin and the cylinder below it.

    Args:
        fx, fy, fz, mx, my, mz: Wrench on the body.
        radius: Of both.

    Returns:
        See `contactsense.solvers.solution`; a miss without a nearest point.
    """
    ff = radius * radius * (fx * fx + fy * fy + fz * fz)
    mm = mx * mx + my * my + mz * mz
    if SMALL < ff < LARGE and mm < LARGE:
        return _fingertip(fx, fy, fz, mx, my, mz, radius)
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    e, g, k = unit_exponents(fx, fy, fz, mx, my, mz, radius)
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, k)
    return rescaled(_fingertip(fx, fy, fz, mx, my, mz, ldexp(radius, -k)), e, g, k)


@kernel
def wrench_axis_fingertip(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, radius: float
) -> Answer:
    """Point where the wrench axis enters the fingertip."""
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    e, g, k = unit_exponents(fx, fy, fz, mx, my, mz, radius)
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, k)
    pitch = (fx * mx + fy * my + fz * mz) / (fx * fx + fy * fy + fz * fz)
    radius = ldexp(radius, -k)
    status, cx, cy, cz, nx, ny, nz, xi, _, _ = _fingertip(
        fx, fy, fz, mx - pitch * fx, my - pitch * fy, mz - pitch * fz, radius
    )
    if status == OK and abs(xi) > _PATCH_TOLERANCE * radius:
        # A contact at the rim would need a torsion that the wrench does not have.
        status = MISS
    if nx == 0.0 and ny == 0.0 and nz == 0.0:
        return no_contact(status)
    return rescaled(
        make_answer(status, fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz, 0.0, 0.0, 0.0), e, g, k
    )
