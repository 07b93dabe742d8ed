"""Geometry of a convex level set: where lines enter it, and the quantities of Newton's method at a point."""

from math import sqrt
from typing import Any

from contactsense.solvers.implicit_surfaces import evaluate
from contactsense.solvers.solution import MISS, OK
from contactsense.solvers.typed_kernel import kernel

_RETRACTIONS = 60
_NEAR = 1e-2
"""Relative to the body's size: from here a point may fall onto the surface towards the inner point."""

Point = tuple[float, float, float]


@kernel
def tangents(nx: float, ny: float, nz: float) -> tuple[float, float, float, float, float, float]:
    """Two unit vectors perpendicular to the unit normal and to each other, t1 x t2 = n (Duff et al.
    2017)."""
    sign = 1.0 if nz >= 0.0 else -1.0
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    return 1.0 + sign * nx * nx * a, sign * b, -sign * nx, b, sign + ny * ny * a, -ny


@kernel
def line_entry(
    size: Any,
    gauge: bool,
    inner: Point,
    reach: float,
    fx: float,
    fy: float,
    fz: float,
    x: float,
    y: float,
    z: float,
) -> Any:
    """Where the line through (x, y, z) along the force enters the body, and the function there.

    The moment m - c x f does not change along the force, so steps that end here are exact in it. The function
    is convex
    on the line: Newton's method from outside does not pass the root, and with the second derivative it also
        comes quickly to where the line grazes.

    Returns:
        Whether it enters, the point, gradient (3) and Hessian (6).
    """
    force = sqrt(fx * fx + fy * fy + fz * fz)
    dx, dy, dz = fx / force, fy / force, fz / force
    level = evaluate(size, x, y, z)
    slope = level[1] * dx + level[2] * dy + level[3] * dz
    careful = False
    if slope >= 0.0:
        # Past the closest point: start outside.
        back = x * dx + y * dy + z * dz + 4.0 * reach
        x, y, z = x - back * dx, y - back * dy, z - back * dz
        level = evaluate(size, x, y, z)
        slope = level[1] * dx + level[2] * dy + level[3] * dz
    hit = False
    for _ in range(_RETRACTIONS):
        if slope >= 0.0:
            break
        value, fall = level[0], slope
        bend = (
            dx * (level[4] * dx + 2.0 * level[7] * dy)
            + dy * (level[5] * dy + 2.0 * level[9] * dz)
            + dz * (level[6] * dz + 2.0 * level[8] * dx)
        )
        if gauge:
            # For half the square of a gauge this is exact on an ellipsoid.
            bend = fall * fall + (1.0 + value) * bend
            fall *= 1.0 + value
            value *= 1.0 + 0.5 * value
        root = fall * fall - 2.0 * value * bend
        step = 2.0 * value / (sqrt(root) - fall) if root > 0.0 and not careful else -value / fall
        ox, oy, oz = x, y, z
        x, y, z = x + step * dx, y + step * dy, z + step * dz
        level = evaluate(size, x, y, z)
        slope = level[1] * dx + level[2] * dy + level[3] * dz
        if slope >= 0.0 and not careful:
            # Overshoot of the second-order step.
            careful = True
            x, y, z = ox, oy, oz
            level = evaluate(size, x, y, z)
            slope = level[1] * dx + level[2] * dy + level[3] * dz
        elif gauge and abs(step) <= _NEAR * reach:
            # Close to the surface: project towards the inner point, at no cost.
            s = 1.0 + level[0]
            return (
                True,
                inner[0] + (x - inner[0]) / s,
                inner[1] + (y - inner[1]) / s,
                inner[2] + (z - inner[2]) / s,
                level[1],
                level[2],
                level[3],
                s * level[4],
                s * level[5],
                s * level[6],
                s * level[7],
                s * level[8],
                s * level[9],
            )
        elif abs(step) <= 1e-9 * reach:
            hit = True
            break
    return (
        hit,
        x,
        y,
        z,
        level[1],
        level[2],
        level[3],
        level[4],
        level[5],
        level[6],
        level[7],
        level[8],
        level[9],
    )


@kernel
def ray_entry(size: Any, gauge: bool, inner: Point, x: float, y: float, z: float) -> Any:
    """Surface point on the ray from the inner point through (x, y, z), and the function there.

    Returns:
        As `line_entry`; there is always one.
    """
    dx, dy, dz = x - inner[0], y - inner[1], z - inner[2]
    level = evaluate(size, x, y, z)
    if gauge:
        s = 1.0 + level[0]
        x, y, z = inner[0] + dx / s, inner[1] + dy / s, inner[2] + dz / s
        # The gradient of a gauge is constant along the ray, and its Hessian scales.
        return (
            True,
            x,
            y,
            z,
            level[1],
            level[2],
            level[3],
            s * level[4],
            s * level[5],
            s * level[6],
            s * level[7],
            s * level[8],
            s * level[9],
        )
    share = 1.0
    for _ in range(_RETRACTIONS):
        slope = level[1] * dx + level[2] * dy + level[3] * dz
        if slope <= 0.0:
            # Too close to the inner point: start further out.
            share *= 2.0
            step = 1.0
        else:
            step = level[0] / slope
            share -= step
        x, y, z = inner[0] + share * dx, inner[1] + share * dy, inner[2] + share * dz
        level = evaluate(size, x, y, z)
        if abs(step) <= 1e-9 * share:
            break
    return (
        True,
        x,
        y,
        z,
        level[1],
        level[2],
        level[3],
        level[4],
        level[5],
        level[6],
        level[7],
        level[8],
        level[9],
    )


@kernel
def tangent_quantities(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    cx: float,
    cy: float,
    cz: float,
    gx: float,
    gy: float,
    gz: float,
    hxx: float,
    hyy: float,
    hzz: float,
    hxy: float,
    hxz: float,
    hyz: float,
) -> Any:
    """Quantities of a Newton step at a surface point, from gradient and Hessian there.

    Returns:
        n (3), t1 (3), t2 (3), F (2), shape operator (11, 12, 22), torsion, f.n.
    """
    slope = sqrt(gx * gx + gy * gy + gz * gz)
    inverse = 1.0 / slope if slope > 0.0 else 0.0
    nx, ny, nz = gx * inverse, gy * inverse, gz * inverse
    ax, ay, az, bx, by, bz = tangents(nx, ny, nz)
    px, py, pz = (
        hxx * ax + hxy * ay + hxz * az,
        hxy * ax + hyy * ay + hyz * az,
        hxz * ax + hyz * ay + hzz * az,
    )
    qx, qy, qz = (
        hxx * bx + hxy * by + hxz * bz,
        hxy * bx + hyy * by + hyz * bz,
        hxz * bx + hyz * by + hzz * bz,
    )
    waa = (ax * px + ay * py + az * pz) * inverse
    wab = (ax * qx + ay * qy + az * qz) * inverse
    wbb = (bx * qx + by * qy + bz * qz) * inverse
    rx, ry, rz = mx - (cy * fz - cz * fy), my - (cz * fx - cx * fz), mz - (cx * fy - cy * fx)
    fa = ax * rx + ay * ry + az * rz
    fb = bx * rx + by * ry + bz * rz
    xi = nx * rx + ny * ry + nz * rz
    push = nx * fx + ny * fy + nz * fz
    return nx, ny, nz, ax, ay, az, bx, by, bz, fa, fb, waa, wab, wbb, xi, push


@kernel
def enter_level(
    size: Any,
    inner: Point,
    reach: float,
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
) -> tuple[int, float, float, float]:
    """Point where the force's line enters the body; on a miss the point of the line with the lowest
    value."""
    ff = fx * fx + fy * fy + fz * fz
    px, py, pz = (fy * mz - fz * my) / ff, (fz * mx - fx * mz) / ff, (fx * my - fy * mx) / ff
    middle = ((inner[0] - px) * fx + (inner[1] - py) * fy + (inner[2] - pz) * fz) / ff
    half = 4.0 * reach / sqrt(ff)
    at = middle - half
    for _ in range(_RETRACTIONS):
        level = evaluate(size, px + at * fx, py + at * fy, pz + at * fz)
        slope = level[1] * fx + level[2] * fy + level[3] * fz
        if slope >= 0.0:
            break
        step = -level[0] / slope
        at += step
        if step <= 4e-16 * (half + abs(at)):
            return OK, px + at * fx, py + at * fy, pz + at * fz
    low, high = middle - half, middle + half
    for _ in range(_RETRACTIONS):
        at = 0.5 * (low + high)
        level = evaluate(size, px + at * fx, py + at * fy, pz + at * fz)
        if level[1] * fx + level[2] * fy + level[3] * fz > 0.0:
            high = at
        else:
            low = at
    return MISS, px + at * fx, py + at * fy, pz + at * fz
