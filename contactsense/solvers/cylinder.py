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

from math import ldexp, sqrt

from contactsense.solvers.solution import (
    LARGE,
    MISS,
    OK,
    PARALLEL,
    PULLING,
    SHARP,
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

_AT_APEX = 1e-15
"""Moment about the apex, relative to that about the origin, that is rounding."""


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
def lateral_frame(
    fx: float, fy: float, mx: float, my: float, radius: float, taper: float, apex: float
) -> tuple[float, float, float, float]:
    """Where the side is described: about the origin, or about the apex if it is steep.

    Args:
        fx, fy, mx, my: Of the wrench about the origin.
        radius, taper: Of the side at the origin.
        apex: Height of the apex; of use if the side is steep.

    Returns:
        m_x and m_y about that point, radius there, and the point's height.
    """
    if abs(taper) <= 1.0:
        return mx, my, radius, 0.0
    return mx + apex * fy, my - apex * fx, 0.0, apex


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
    rho: float,
    taper: float,
) -> Answer:
    """Answer for a contact at height `z` in the radial direction (ex, ey), `rho` from the axis."""
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
def _at_apex(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, apex: float, taper: float
) -> Answer:
    """Answer at the apex, taken as a ball without radius.

    A moment about it is a torsion there, so it gives the normal, which must be one of the ball's. Without it
    the force must enter the body there, or push against one of these normals.
    """
    lx, ly, lz = mx + apex * fy, my - apex * fx, mz
    mm = mx * mx + my * my + mz * mz
    ll = lx * lx + ly * ly + lz * lz
    ff = fx * fx + fy * fy + fz * fz
    up = 1.0 if taper > 0.0 else -1.0
    steep = abs(taper)
    across = sqrt(fx * fx + fy * fy)
    if ll <= _AT_APEX * _AT_APEX * (mm + apex * apex * ff):
        if not (up * fz < 0.0 and (across < -steep * up * fz or steep * across < -up * fz)):
            return no_contact(MISS)
        force = sqrt(ff)
        nx, ny, nz, xi = -fx / force, -fy / force, -fz / force, 0.0
    else:
        xi = sqrt(ll)
        if lx * fx + ly * fy + lz * fz > 0.0:
            xi = -xi
        nx, ny, nz = lx / xi, ly / xi, lz / xi
        if not (steep * sqrt(nx * nx + ny * ny) <= up * nz and nx * fx + ny * fy + nz * fz < 0.0):
            return no_contact(MISS)
    return make_answer(SHARP, fx, fy, fz, mx, my, mz, 0.0, 0.0, apex, nx, ny, nz, xi, 0.0, 0.0)


@kernel
def _cone(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, radius: float, taper: float
) -> Answer:
    apex = radius / taper
    lx, ly, base, below = lateral_frame(fx, fy, mx, my, radius, taper, apex)
    disc, a, b, u, v = directions(fx, fy, lx, ly, mz, base, taper)
    ex = ey = z = rho = 0.0
    status = MISS
    if disc > 0.0:
        for sign in (-1.0, 1.0):
            ax, ay = a + sign * u, b + sign * v
            at, push = height(fx, fy, fz, lx, ly, ax, ay, base, taper)
            # The mirrored cone beyond the apex does not belong to the body.
            if push != 0.0 and base - taper * at > 0.0 and status != OK:
                ex, ey, z, rho = ax, ay, at + below, base - taper * at
                status = OK if push < 0.0 else PULLING
    if status != OK:
        answer = _at_apex(fx, fy, fz, mx, my, mz, apex, taper)
        if answer[0] == SHARP or status == MISS:
            return answer
    return on_lateral(status, fx, fy, fz, mx, my, mz, ex, ey, z, rho, taper)


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
        See `contactsense.solvers.solution`; `SHARP` where the wrench acts on the apex. A miss has no nearest
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
