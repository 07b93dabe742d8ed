"""Nearest point and curvature of bodies of revolution without branches, for loops over several bodies that
are vectorized; the same as `project` and `curvature` of `contactsense.robots.surface.convex_primitives`."""

from math import fabs, sqrt

from contactsense.robots.jit.kernel import inlined_fused_kernel
from contactsense.robots.surface.convex_primitives import SAME_NORMAL, TOUCHING, ShapeOperator
from contactsense.robots.surface.ellipsoid_projection import Projection

Profile = tuple[float, float, float, float, float, float, float]
"""Result of `profile`."""
_TINY = 1e-300
"""Keeps quotients finite that are not used."""


@inlined_fused_kernel
def profile(h: float, R0: float, R1: float, r: float) -> Profile:
    """What the shape of a body of revolution depends on.

    Args:
        h, R0, R1, r: Its size, as for `REVOLVED` in `contactsense.robots.surface.convex_primitives` [m].

    Returns:
        The size; direction (dz, dr) of the slanted side of its core, and that side's length [m].
    """
    along, across = 2.0 * h, R1 - R0
    length = sqrt(along * along + across * across)
    scale = 1.0 / max(length, _TINY)
    return h, R0, R1, r, (along * scale if length > 0.0 else 1.0), across * scale, length


@inlined_fused_kernel
def project_revolved(body: Profile, x: float, y: float, z: float) -> Projection:
    """Nearest surface point of a body of revolution to the point (x, y, z), body frame [m].

    Returns:
        Signed distance [m], the point [m] and the outward unit normal there, as `project` does.
    """
    h, R0, R1, r, dz, dr, length = body
    rho = sqrt(x * x + y * y)
    inverse = 1.0 / max(rho, _TINY)
    ux = x * inverse if rho > 0.0 else 1.0
    uy = y * inverse
    s = (rho - R0) * dz - (z + h) * dr
    top = fabs(z) - h
    sign = 1.0 if z > 0.0 else -1.0
    # The nearest point of the core, from outside: on a cap or on the slanted side.
    t = min(max((z + h) * dz + (rho - R0) * dr, 0.0), length)
    over_cap = (top > 0.0) & (rho <= (R1 if z > 0.0 else R0))
    qz = sign * h if over_cap else t * dz - h
    qr = rho if over_cap else R0 + t * dr
    ez, er = z - qz, rho - qr
    distance = sqrt(ez * ez + er * er)
    inverse = 1.0 / max(distance, TOUCHING)
    outside = ((s > 0.0) | (top > 0.0)) & (distance > TOUCHING)
    # Inside the core, or so near to it that rounding decides: the face whose plane is nearest.
    beside = s >= top
    distance = distance if outside else (s if beside else top)
    nz = ez * inverse if outside else (-dr if beside else sign)
    nr = er * inverse if outside else (dz if beside else 0.0)
    reach = distance - r
    pr = rho - reach * nr
    return reach, pr * ux, pr * uy, z - reach * nz, nr * ux, nr * uy, nz


@inlined_fused_kernel
def curvature_revolved(body: Profile, px: float, py: float, nx: float, ny: float, nz: float) -> ShapeOperator:
    """Shape operator of a body of revolution at a surface point with that normal, as `curvature` does."""
    _, R0, R1, r, dz, dr, length = body
    rho = sqrt(px * px + py * py)
    nr = sqrt(nx * nx + ny * ny)
    inverse_radius, inverse = 1.0 / max(r, _TINY), 1.0 / max(nr, _TINY)
    k = inverse_radius if r > 0.0 else 0.0
    around = nr / max(max(rho, r * nr), _TINY)
    # On a slanted side the meridian does not bend.
    along = 0.0 if (length > 0.0) & (fabs(nz * dz + nr * dr) <= SAME_NORMAL) else k
    cx, cy = -ny * inverse, nx * inverse
    mx, my = -cy * nz, cx * nz
    xx, xy, xz = around * cx * cx + along * mx * mx, around * cx * cy + along * mx * my, along * mx * nr
    yy, yz, zz = around * cy * cy + along * my * my, along * my * nr, along * nr * nr
    # On the axis: a flat cap, or the pole of a ball.
    on_axis = nr <= SAME_NORMAL
    end_radius = R1 if nz > 0.0 else R0
    at_pole = 0.0 if end_radius > 0.0 else k
    return (
        at_pole if on_axis else xx,
        0.0 if on_axis else xy,
        0.0 if on_axis else xz,
        at_pole if on_axis else yy,
        0.0 if on_axis else yz,
        0.0 if on_axis else zz,
    )
