"""The paper's fingertip (figure 5): a hemisphere on a cylinder of the same radius, open below."""

from math import ldexp

from contactsense.solvers.answer import (
    LARGE,
    MISS,
    OK,
    SMALL,
    Answer,
    finish,
    nothing,
    rescaled,
    scaled,
    unit_exponents,
    unusable,
)
from contactsense.solvers.capsule import ball
from contactsense.solvers.cylinder import directions, height, on_lateral
from contactsense.solvers.typed import kernel

_SEAM = 1e-9
"""How far outside of its patch, relative to the radius, a contact may lie by rounding."""


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
    if min(over, below) > _SEAM * radius:
        return nothing(MISS)
    if over < below:
        return on_lateral(OK, fx, fy, fz, mx, my, mz, ex, ey, z, radius, 0.0)
    bend = 1.0 / radius
    cx, cy, cz = radius * nx, radius * ny, radius * nz
    return finish(OK, fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz, xi, 2.0 * bend, bend * bend)


@kernel
def solve_fingertip(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, radius: float
) -> Answer:
    """Contact centroid on the hemisphere z > 0 about the origin and the cylinder below it.

    Args:
        fx, fy, fz, mx, my, mz: Wrench on the body.
        radius: Of both.

    Returns:
        See `contactsense.solvers.answer`; a miss without a nearest point.
    """
    ff = radius * radius * (fx * fx + fy * fy + fz * fz)
    mm = mx * mx + my * my + mz * mz
    if SMALL < ff < LARGE and mm < LARGE:
        return _fingertip(fx, fy, fz, mx, my, mz, radius)
    status = unusable(fx, fy, fz, mx, my, mz)
    if status != OK:
        return nothing(status)
    e, g, k = unit_exponents(fx, fy, fz, mx, my, mz, radius)
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, k)
    return rescaled(_fingertip(fx, fy, fz, mx, my, mz, ldexp(radius, -k)), e, g, k)


@kernel
def wrench_axis_fingertip(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, radius: float
) -> Answer:
    """Where the wrench axis enters the fingertip."""
    status = unusable(fx, fy, fz, mx, my, mz)
    if status != OK:
        return nothing(status)
    e, g, k = unit_exponents(fx, fy, fz, mx, my, mz, radius)
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, k)
    pitch = (fx * mx + fy * my + fz * mz) / (fx * fx + fy * fy + fz * fz)
    radius = ldexp(radius, -k)
    status, cx, cy, cz, nx, ny, nz, xi, _, _ = _fingertip(
        fx, fy, fz, mx - pitch * fx, my - pitch * fy, mz - pitch * fz, radius
    )
    if status == OK and abs(xi) > _SEAM * radius:
        # Only a torsion that is not there would hold the force at the rim.
        status = MISS
    if nx == 0.0 and ny == 0.0 and nz == 0.0:
        return nothing(status)
    return rescaled(finish(status, fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz, 0.0, 0.0, 0.0), e, g, k)
