"""Nearest point on an ellipsoid."""

from math import sqrt

import numpy as np

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector

Dimensions = np.ndarray | tuple[float, ...]
"""Dimensions of a primitive, as `contactsense.robots.surface.convex_primitives` lists them by kind [m]."""
Projection = tuple[float, float, float, float, float, float, float]
"""Signed distance, nearest surface point and outward unit normal."""


@kernel
def nearest_on_ellipsoid(size: Dimensions, x: float, y: float, z: float) -> Projection:
    """Signed distance, nearest surface point and outward unit normal, as of
    `contactsense.robots.surface.convex_primitives.project`."""
    # Nearest point c with c_i = a_i^2 y_i / (t + a_i^2); t is the largest root of F(t) = sum (a_i y_i / (t +
    # a_i^2))^2 - 1, which falls and is convex, so Newton from the left runs monotonously into it (Eberly,
    # "Distance from a point to an ellipse, an ellipsoid, or a hyperellipsoid", 2013).
    a, b, c = size[0], size[1], size[2]
    aa, bb, cc = a * a, b * b, c * c
    smallest = min(aa, min(bb, cc))
    # Squares of the parts of the query along the shortest axis, or axes, where F has its pole.
    short_squared = 0.0
    if aa == smallest:
        short_squared += x * x
    if bb == smallest:
        short_squared += y * y
    if cc == smallest:
        short_squared += z * z
    offset = sqrt(smallest * short_squared)
    # F at the left end of the bracket; the shortest axes give exactly 1 there, also in the limit lift = 0.
    remainder = 0.0
    if aa > smallest:
        remainder += (a * x / (offset + (aa - smallest))) ** 2
    if bb > smallest:
        remainder += (b * y / (offset + (bb - smallest))) ** 2
    if cc > smallest:
        remainder += (c * z / (offset + (cc - smallest))) ** 2
    if offset > 1e-14 * smallest or remainder >= 1.0:
        px, py, pz = _by_newton(size, x, y, z, offset)
    else:
        px, py, pz = _across_shortest_axis(size, x, y, z)
    nx, ny, nz = px / aa, py / bb, pz / cc
    norm = sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = nx / norm, ny / norm, nz / norm
    ex, ey, ez = x - px, y - py, z - pz
    distance = sqrt(ex * ex + ey * ey + ez * ez)
    if (x / a) ** 2 + (y / b) ** 2 + (z / c) ** 2 < 1.0:
        distance = -distance
    return distance, px, py, pz, nx, ny, nz


@kernel
def _by_newton(size: Dimensions, x: float, y: float, z: float, left: float) -> Vector:
    """Nearest point by the largest root t of F; `left`: left end of its bracket, as t + min(a_i^2)."""
    a, b, c = size[0], size[1], size[2]
    aa, bb, cc = a * a, b * b, c * c
    smallest = min(aa, min(bb, cc))
    w = left  # t + smallest
    for _ in range(60):
        ia, ib, ic = w + (aa - smallest), w + (bb - smallest), w + (cc - smallest)
        if ia <= 0.0 or ib <= 0.0 or ic <= 0.0:
            # On the pole itself, without a part along a shortest axis: step off it to the right.
            w = 1e-15 * smallest
            continue
        ga, gb, gc = a * x / ia, b * y / ib, c * z / ic
        F = ga * ga + gb * gb + gc * gc - 1.0
        slope = -2.0 * (ga * ga / ia + gb * gb / ib + gc * gc / ic)
        if slope == 0.0:
            break
        step = -F / slope
        w += step
        if step <= 1e-16 * w:
            break
    return aa * x / (w + (aa - smallest)), bb * y / (w + (bb - smallest)), cc * z / (w + (cc - smallest))


@kernel
def _across_shortest_axis(size: Dimensions, x: float, y: float, z: float) -> Vector:
    """Nearest point of one deep inside, in the plane of symmetry across a shortest axis: both sides are
    equally near, take the plus side."""
    aa, bb, cc = size[0] * size[0], size[1] * size[1], size[2] * size[2]
    smallest = min(aa, min(bb, cc))
    px = aa * x / (aa - smallest) if aa > smallest else 0.0
    py = bb * y / (bb - smallest) if bb > smallest else 0.0
    pz = cc * z / (cc - smallest) if cc > smallest else 0.0
    height = sqrt(smallest * max(0.0, 1.0 - px * px / aa - py * py / bb - pz * pz / cc))
    if aa == smallest:
        return height if x >= 0.0 else -height, py, pz
    if bb == smallest:
        return px, height if y >= 0.0 else -height, pz
    return px, py, height if z >= 0.0 else -height
