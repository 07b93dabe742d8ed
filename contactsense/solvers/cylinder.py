"""Cylinder and cone about z: closed forms.

Both are one surface, of radius R - z tan(beta) at height z. With e the radial direction of the contact, the
moment about the generator through it gives the direction alone, and the moment about the circle's tangent the
height:

    e.p = m_z,      p = (R f_y + tan(beta) m_x, -R f_x + tan(beta) m_y)
    z = (m_theta + R f_z) / (f_rho + tan(beta) f_z)

For beta = 0 this is the paper's cylinder (section 5.1.2) without its division by the torsion: where the
contact lies around the axis does not depend on it.
"""

from math import ldexp, sqrt

from contactsense.solvers.solution import (
    LARGE,
    MISS,
    OK,
    PARALLEL,
    PULLING,
    SMALL,
    TANGENT,
    TINY,
    Answer,
    input_status,
    make_answer,
    no_contact,
    rescaled,
    scaled,
    torsion,
    unit_exponents,
)
from contactsense.solvers.typed_kernel import kernel


@kernel
def directions(
    fx: float, fy: float, mx: float, my: float, mz: float, radius: float, taper: float
) -> tuple[float, float, float, float, float]:
    """The two radial directions with e.p = m_z are (a, b) + (u, v) and (a, b) - (u, v).

    Returns:
        The discriminant |p|^2 - m_z^2 (no direction exists where it is negative), then a, b, u, v. On a
        cylinder the pushing one is the second.
    """
    px = radius * fy + taper * mx
    py = taper * my - radius * fx
    pp = px * px + py * py
    if pp < TINY:
        return -1.0, 0.0, 0.0, 0.0, 0.0
    disc = pp - mz * mz
    inverse = 1.0 / pp
    along = mz * inverse
    across = sqrt(max(disc, 0.0)) * inverse
    return disc, along * px, along * py, -across * py, across * px


@kernel
def height(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    ex: float,
    ey: float,
    radius: float,
    taper: float,
) -> tuple[float, float]:
    """Height of the contact whose radial direction is (ex, ey), and f.n / cos(beta) there."""
    push = ex * fx + ey * fy + taper * fz
    return (ex * my - ey * mx + radius * fz) / push, push


@kernel
def on_lateral(
    status: int,
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    ex: float,
    ey: float,
    z: float,
    radius: float,
    taper: float,
) -> Answer:
    """Answer for a contact at height `z` in the radial direction (ex, ey)."""
    rho = radius - taper * z
    cos_beta = 1.0 / sqrt(1.0 + taper * taper)
    nx, ny, nz = cos_beta * ex, cos_beta * ey, cos_beta * taper
    cx, cy, xi = rho * ex, rho * ey, 0.0
    if status <= PULLING:
        xi = torsion(fx, fy, fz, mx, my, mz, cx, cy, z, nx, ny, nz)
    return make_answer(status, fx, fy, fz, mx, my, mz, cx, cy, z, nx, ny, nz, xi, cos_beta / rho, 0.0)


@kernel
def _nearest_height(fx: float, fy: float, fz: float, mx: float, my: float, mz: float) -> float:
    """Height at which the force's line is nearest to the axis."""
    ff = fx * fx + fy * fy + fz * fz
    rx = (fy * mz - fz * my) / ff
    ry = (fz * mx - fx * mz) / ff
    rz = (fx * my - fy * mx) / ff
    return rz - fz * (fx * rx + fy * ry) / (fx * fx + fy * fy)


@kernel
def _cylinder(fx: float, fy: float, fz: float, mx: float, my: float, mz: float, radius: float) -> Answer:
    if radius * radius * (fx * fx + fy * fy) < TINY:
        return no_contact(PARALLEL)
    disc, a, b, u, v = directions(fx, fy, mx, my, mz, radius, 0.0)
    if disc > 0.0:
        ex, ey = a - u, b - v
        z = radius * (ex * my - ey * mx + radius * fz) / -sqrt(disc)
        return on_lateral(OK, fx, fy, fz, mx, my, mz, ex, ey, z, radius, 0.0)
    size = sqrt(a * a + b * b)
    z = _nearest_height(fx, fy, fz, mx, my, mz)
    status = MISS if disc < 0.0 else TANGENT
    return on_lateral(status, fx, fy, fz, mx, my, mz, a / size, b / size, z, radius, 0.0)


@kernel
def solve_cylinder(fx: float, fy: float, fz: float, mx: float, my: float, mz: float, radius: float) -> Answer:
    """Contact centroid on an infinite cylinder about z (paper, section 5.1.2).

    Args:
        fx, fy, fz, mx, my, mz: Wrench on the body.
        radius: Of the cylinder.

    Returns:
        See `contactsense.solvers.solution`. A solution exists for |m_z| < radius |(fx, fy)|.
    """
    pp = radius * radius * (fx * fx + fy * fy)
    mm = mx * mx + my * my + mz * mz
    if SMALL < pp < LARGE and mm < LARGE and radius * abs(fz) < LARGE:
        return _cylinder(fx, fy, fz, mx, my, mz, radius)
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    e, g, k = unit_exponents(fx, fy, fz, mx, my, mz, radius)
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, k)
    return rescaled(_cylinder(fx, fy, fz, mx, my, mz, ldexp(radius, -k)), e, g, k)


@kernel
def _cone(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, radius: float, taper: float
) -> Answer:
    disc, a, b, u, v = directions(fx, fy, mx, my, mz, radius, taper)
    if disc <= 0.0:
        return no_contact(MISS)
    ex = ey = z = 0.0
    status = MISS
    for sign in (-1.0, 1.0):
        ax, ay = a + sign * u, b + sign * v
        at, push = height(fx, fy, fz, mx, my, ax, ay, radius, taper)
        # The mirrored cone beyond the apex does not belong to the body.
        if push != 0.0 and radius - taper * at > 0.0 and status != OK:
            ex, ey, z = ax, ay, at
            status = OK if push < 0.0 else PULLING
    if status == MISS:
        return no_contact(MISS)
    return on_lateral(status, fx, fy, fz, mx, my, mz, ex, ey, z, radius, taper)


@kernel
def solve_cone(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, radius: float, taper: float
) -> Answer:
    """Contact centroid on the endless cone of radius `radius` - `taper` z about z, up to its apex.

    Args:
        fx, fy, fz, mx, my, mz: Wrench on the body.
        radius: At z = 0, positive.
        taper: Tangent of the angle between side and axis, not zero.

    Returns:
        See `contactsense.solvers.solution`; where no contact exists, or only one that pulls, no nearest
        point.
    """
    ff = fx * fx + fy * fy + fz * fz
    mm = mx * mx + my * my + mz * mz
    if radius * radius * ff > SMALL and (1.0 + radius * radius) * ff < LARGE and mm < LARGE:
        return _cone(fx, fy, fz, mx, my, mz, radius, taper)
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    e, g, k = unit_exponents(fx, fy, fz, mx, my, mz, radius)
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, k)
    return rescaled(_cone(fx, fy, fz, mx, my, mz, ldexp(radius, -k), taper), e, g, k)
