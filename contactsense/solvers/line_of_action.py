"""Intersection of the line of action of the measured force with a primitive (the paper, section 4).

The line of action (wrench axis) is where the moment is parallel to the force. Its first intersection with
a primitive is the initial guess for the contact. The signed distance to a convex body is a convex function
along a line, so Newton's method, started outside, converges monotonically to the first intersection. If
the line misses the body, the guess is the nearest point of the body, moved towards the side on which the
force pushes.
"""

import math

import numpy as np

from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.surface.convex_primitives import REVOLVED, project
from contactsense.robots.vectors import Vector
from contactsense.solvers.wrench import Wrench

_MAX_ITERATIONS = 30
ENTRY_TOLERANCE = 1e-4
"""Distance from the surface at which the line counts as having entered, relative to the bounding radius."""


@fused_kernel
def _start_parameter(
    kind: int,
    size: np.ndarray,
    radius: float,
    ax: float,
    ay: float,
    az: float,
    ux: float,
    uy: float,
    uz: float,
) -> float:
    """Parameter s of a point on the line a + s u outside the body, before it enters.

    The line enters the bounding sphere or, for a body of revolution, the bounding cylinder there.
    """
    s = -1.001 * radius
    if kind == REVOLVED:
        across = ux * ux + uy * uy
        if across > 1e-12:
            middle = -(ax * ux + ay * uy) / across
            max_radius = max(size[1], size[2]) + size[3]
            discriminant = middle * middle - (ax * ax + ay * ay - max_radius * max_radius) / across
            if discriminant > 0.0:
                s = max(s, middle - math.sqrt(discriminant))
        if abs(uz) > 1e-9:
            s = max(s, -(size[0] + size[3]) / abs(uz) - az / uz)
    return s


@fused_kernel
def enter_surface(kind: int, size: np.ndarray, radius: float, wrench: Wrench) -> tuple[float, Vector, Vector]:
    """Point where the line of action enters a primitive.

    Args:
        kind, size, radius: The primitive as in `contactsense.robots.surface.convex_primitives.Surfaces`,
            and its bounding radius [m].
        wrench: Force [N] and moment about the origin of the body frame [Nm], body axes.

    Returns:
        Lower bound of the distance between line and body [m], 0 if they intersect; and surface point [m] and
        outward unit normal at the intersection or the nearest approach, body frame.
    """
    (fx, fy, fz), (mx, my, mz) = wrench
    ff = fx * fx + fy * fy + fz * fz
    if ff <= 0.0:
        x, y, z, nx, ny, nz = project(kind, size, 0.0, 0.0, radius)[1:]
        return 0.0, (x, y, z), (nx, ny, nz)
    f = math.sqrt(ff)
    ux, uy, uz = fx / f, fy / f, fz / f
    # Point of the line nearest to the body's centre (paper, equation 6).
    ax, ay, az = (fy * mz - fz * my) / ff, (fz * mx - fx * mz) / ff, (fx * my - fy * mx) / ff
    s = _start_parameter(kind, size, radius, ax, ay, az, ux, uy, uz)
    left, left_d, left_slope = s, 0.0, 0.0
    right, right_d, right_slope = s, 0.0, -1.0
    gap = 0.0
    for _ in range(_MAX_ITERATIONS):
        x, y, z = ax + s * ux, ay + s * uy, az + s * uz
        d, px, py, pz, nx, ny, nz = project(kind, size, x, y, z)
        slope = nx * ux + ny * uy + nz * uz
        if slope < 0.0:
            if d <= ENTRY_TOLERANCE * radius:
                return 0.0, (px, py, pz), (nx, ny, nz)
            left, left_d, left_slope = s, d, slope
            if right_slope < 0.0:
                # No point beyond the nearest approach yet: Newton step to the zero of the tangent.
                s = min(s - d / slope, 1.001 * radius)
                continue
        else:
            right, right_d, right_slope = s, d, slope
            if left_slope == 0.0:
                # Started beyond the nearest approach: Newton step back.
                s = max(s - d / slope, -1.001 * radius) if slope > 0.0 else -1.001 * radius
                continue
        # The nearest approach is bracketed. The convex distance lies above both tangents, so their
        # intersection is a lower bound.
        s = (left_d - right_d + right_slope * right - left_slope * left) / (right_slope - left_slope)
        gap = left_d + left_slope * (s - left)
        if min(left_d, right_d) - gap < 0.02 * radius:
            break
    # The line misses the body: project a point upstream of the nearest approach, so that the force pushes.
    shift = radius + max(gap, 0.0)
    x, y, z = ax + (s - shift) * ux, ay + (s - shift) * uy, az + (s - shift) * uz
    px, py, pz, nx, ny, nz = project(kind, size, x, y, z)[1:]
    return max(gap, 0.0), (px, py, pz), (nx, ny, nz)
