"""A first guess for the contact on one primitive: where the wrench axis enters it (the paper, section 4).

The signed distance to a convex body is a convex function along a line, so Newton's method from outside runs
monotonously into the first crossing, whatever the body. Where the axis misses, the guess is the place of the
body nearest to it, turned towards the force so that it can push.
"""

import math

from robots.compiled import kernel
from robots.surface import project

_STEPS = 30


@kernel
def enter(kind, size, radius, fx, fy, fz, mx, my, mz):  # type: ignore[no-untyped-def]
    """Where the wrench axis enters a primitive, pushing.

    Args:
        kind, size, radius: The primitive as in `robots.surface.Surfaces`; its bounding radius [m].
        fx, fy, fz, mx, my, mz: Force [N] and moment about the origin of the body frame [Nm], body axes.

    Returns:
        Whether the axis hits, and the surface point (3 floats) and normal (3 floats) there, body frame.
    """
    ff = fx * fx + fy * fy + fz * fz
    if ff <= 0.0:
        x, y, z, nx, ny, nz = project(kind, size, 0.0, 0.0, radius)[1:]
        return False, x, y, z, nx, ny, nz
    f = math.sqrt(ff)
    ux, uy, uz = fx / f, fy / f, fz / f
    # Point of the axis nearest to the body's centre (paper, equation 6), then back along it to outside the
    # body.
    ax, ay, az = (fy * mz - fz * my) / ff, (fz * mx - fx * mz) / ff, (fx * my - fy * mx) / ff
    s = -math.sqrt(max(0.0, radius * radius - (ax * ax + ay * ay + az * az))) - 1e-3 * radius
    for _ in range(_STEPS):
        x, y, z = ax + s * ux, ay + s * uy, az + s * uz
        d, px, py, pz, nx, ny, nz = project(kind, size, x, y, z)
        slope = nx * ux + ny * uy + nz * uz
        if d <= 1e-9 * radius and slope < 0.0:
            return True, px, py, pz, nx, ny, nz
        if slope >= -1e-9:
            break
        s -= d / slope
    # Missed: from the nearest approach, half a turn towards the side that the force can push on.
    d, px, py, pz, nx, ny, nz = project(kind, size, x, y, z)
    shift = radius + d
    px, py, pz, nx, ny, nz = project(kind, size, x - shift * ux, y - shift * uy, z - shift * uz)[1:]
    return False, px, py, pz, nx, ny, nz
