"""A first guess for the contact on one primitive: where the wrench axis enters it (the paper, section 4).

The signed distance to a convex body is a convex function along a line, so Newton's method from outside runs
monotonously into the first crossing, whatever the body. Where the axis misses, the guess is the place of the
body nearest to it, turned towards the force so that it can push.
"""

import math

from robots.compiled import fused_kernel
from robots.surface import REVOLVED, project

_STEPS = 30
NEAR = 1e-4
"""Distance from the surface, in parts of the bounding radius, at which the axis counts as having entered."""


@fused_kernel
def _approach(kind, size, radius, ax, ay, az, ux, uy, uz):  # type: ignore[no-untyped-def]
    """A place on the line a + s u before it enters the body: where it enters the ball or the can about it."""
    s = -1.001 * radius
    if kind == REVOLVED:
        across = ux * ux + uy * uy
        if across > 1e-12:
            middle = -(ax * ux + ay * uy) / across
            wide = max(size[1], size[2]) + size[3]
            chord = middle * middle - (ax * ax + ay * ay - wide * wide) / across
            if chord > 0.0:
                s = max(s, middle - math.sqrt(chord))
        if abs(uz) > 1e-9:
            s = max(s, -(size[0] + size[3]) / abs(uz) - az / uz)
    return s


@fused_kernel
def enter(kind, size, radius, fx, fy, fz, mx, my, mz):  # type: ignore[no-untyped-def]
    """Where the wrench axis enters a primitive, pushing.

    Args:
        kind, size, radius: The primitive as in `robots.surface.Surfaces`; its bounding radius [m].
        fx, fy, fz, mx, my, mz: Force [N] and moment about the origin of the body frame [Nm], body axes.

    Returns:
        How far the axis stays away from the body at least, 0 where it hits [m], and the surface point (3
        floats) and normal (3 floats) where it enters or comes nearest, body frame.
    """
    ff = fx * fx + fy * fy + fz * fz
    if ff <= 0.0:
        x, y, z, nx, ny, nz = project(kind, size, 0.0, 0.0, radius)[1:]
        return 0.0, x, y, z, nx, ny, nz
    f = math.sqrt(ff)
    ux, uy, uz = fx / f, fy / f, fz / f
    # Point of the axis nearest to the body's centre (paper, equation 6), then back along it to outside the
    # body.
    ax, ay, az = (fy * mz - fz * my) / ff, (fz * mx - fx * mz) / ff, (fx * my - fy * mx) / ff
    s = _approach(kind, size, radius, ax, ay, az, ux, uy, uz)
    left, left_d, left_slope = s, 0.0, 0.0
    right, right_d, right_slope = s, 0.0, -1.0
    gap = 0.0
    for _ in range(_STEPS):
        x, y, z = ax + s * ux, ay + s * uy, az + s * uz
        d, px, py, pz, nx, ny, nz = project(kind, size, x, y, z)
        slope = nx * ux + ny * uy + nz * uz
        if slope < 0.0:
            if d <= NEAR * radius:
                return 0.0, px, py, pz, nx, ny, nz
            left, left_d, left_slope = s, d, slope
            if right_slope < 0.0:
                # Nothing found yet on the far side of the nearest approach: on to where the tangent meets
                # zero.
                s = min(s - d / slope, 1.001 * radius)
                continue
        else:
            right, right_d, right_slope = s, d, slope
            if left_slope == 0.0:
                # Started beyond the nearest approach: back to where the tangent meets zero.
                s = max(s - d / slope, -1.001 * radius) if slope > 0.0 else -1.001 * radius
                continue
        # The nearest approach lies between: the distance, being convex, is above both tangents, and above
        # where
        # they meet.
        s = (left_d - right_d + right_slope * right - left_slope * left) / (right_slope - left_slope)
        gap = left_d + left_slope * (s - left)
        if min(left_d, right_d) - gap < 0.02 * radius:
            break
    # Missed: from the nearest approach, half a turn towards the side that the force can push on.
    shift = radius + max(gap, 0.0)
    x, y, z = ax + (s - shift) * ux, ay + (s - shift) * uy, az + (s - shift) * uz
    px, py, pz, nx, ny, nz = project(kind, size, x, y, z)[1:]
    return max(gap, 0.0), px, py, pz, nx, ny, nz
