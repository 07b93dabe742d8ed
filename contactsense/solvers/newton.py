"""Newton's method on any smooth convex body: two unknowns in the tangent plane (theory, section 4).

At a surface point c, with the moment r = m - c x f about it, the tangential part F = T^T r must vanish. A
step T v changes it by M v, M = fn J - xi W, whose determinant fn^2 + xi^2 det W is positive wherever the
force pushes: flat or curved, with or without torsion. So a line search on |F| has no local minima. It may
end at the rim of the pushed side, or slow down where M is nearly singular.
"""

from math import sqrt
from typing import Any

from contactsense.solvers.level_set import Point, line_entry, ray_entry, tangent_quantities, tangents
from contactsense.solvers.solution import invariant, is_contact
from contactsense.solvers.typed_kernel import kernel

_STEPS = 40
_HALVINGS = 12
_FIRST_HALVINGS = 5
_MIN_PUSH = 0.5
"""Cosine between force and inward normal from which on the slopes are the better unknowns."""


@kernel
def slope_step(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    x: float,
    y: float,
    z: float,
    gx: float,
    gy: float,
    gz: float,
    hxx: float,
    hyy: float,
    hzz: float,
    hxy: float,
    hxz: float,
    hyz: float,
) -> tuple[float, float, float]:
    """Newton's step for the slopes, in the tangent plane.

    Seen along the force, the pushed side is the graph of a concave height h over the plane square to it. With
    the line of the force through q0 and its pitch p = f.m / |f|^2 the contact over q obeys

        p grad h + J (q - q0) = 0,      J a quarter turn,

    a monotone equation whose Jacobian p hess h + J has a determinant of at least one. Without torsion it is
    linear.
    """
    ff = fx * fx + fy * fy + fz * fz
    force = sqrt(ff)
    ux, uy, uz = -fx / force, -fy / force, -fz / force
    ax, ay, az, bx, by, bz = tangents(ux, uy, uz)
    pitch = (fx * mx + fy * my + fz * mz) / ff
    ox, oy, oz = x - (fy * mz - fz * my) / ff, y - (fz * mx - fx * mz) / ff, z - (fx * my - fy * mx) / ff
    ga, gb, gu = gx * ax + gy * ay + gz * az, gx * bx + gy * by + gz * bz, gx * ux + gy * uy + gz * uz
    ha, hb = -ga / gu, -gb / gu
    # Directions along the graph: a + ha u and b + hb u.
    px, py, pz = ax + ha * ux, ay + ha * uy, az + ha * uz
    qx, qy, qz = bx + hb * ux, by + hb * uy, bz + hb * uz
    kx, ky, kz = (
        hxx * px + hxy * py + hxz * pz,
        hxy * px + hyy * py + hyz * pz,
        hxz * px + hyz * py + hzz * pz,
    )
    lx, ly, lz = (
        hxx * qx + hxy * qy + hxz * qz,
        hxy * qx + hyy * qy + hyz * qz,
        hxz * qx + hyz * qy + hzz * qz,
    )
    scale = -pitch / gu
    aa = scale * (px * kx + py * ky + pz * kz)
    ab = scale * (qx * kx + qy * ky + qz * kz)
    bb = scale * (qx * lx + qy * ly + qz * lz)
    first = pitch * ha - (ox * bx + oy * by + oz * bz)
    second = pitch * hb + (ox * ax + oy * ay + oz * az)
    det = 1.0 + aa * bb - ab * ab
    va = -(bb * first - (ab - 1.0) * second) / det
    vb = -(aa * second - (ab + 1.0) * first) / det
    return va * px + vb * qx, va * py + vb * qy, va * pz + vb * qz


@kernel
def newton_iteration(
    size: Any,
    gauge: bool,
    inner: Point,
    reach: float,
    lever: float,
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    x: float,
    y: float,
    z: float,
) -> tuple[bool, int, float, float, float, float, float, float, float, float, float]:
    """Newton's method from the point where the line through (x, y, z) along the force enters the body.

    If the force pushes well, the step is that of the slopes, and ends along the force. If it grazes, or
    if that step fails, the step is in the tangent plane, and ends towards the inner point. Either must
    reduce |F|.

    Args:
        size, gauge: The body.
        inner: A point well inside.
        reach: Its size.
        lever: Bound of its distance from the origin.
        fx, fy, fz, mx, my, mz: Wrench.
        x, y, z: Start.

    Returns:
        Whether it converged, the number of steps, the point, the normal there, torsion, and the shape
        operator's trace and determinant.
    """
    hit, cx, cy, cz, gx, gy, gz, hxx, hyy, hzz, hxy, hxz, hyz = line_entry(
        size, gauge, inner, reach, fx, fy, fz, x, y, z
    )
    nx, ny, nz, ax, ay, az, bx, by, bz, fa, fb, waa, wab, wbb, xi, push = tangent_quantities(
        fx, fy, fz, mx, my, mz, cx, cy, cz, gx, gy, gz, hxx, hyy, hzz, hxy, hxz, hyz
    )
    force = sqrt(fx * fx + fy * fy + fz * fz)
    # Rounding error of the moment.
    floor = 4e-16 * (sqrt(mx * mx + my * my + mz * mz) + lever * force)
    tolerance = floor * floor
    squared_residual = fa * fa + fb * fb
    step = 0
    improved = hit and push < 0.0
    while improved and step < _STEPS and squared_residual > tolerance:
        step += 1
        improved = False
        pushes_well = push < -_MIN_PUSH * force
        for attempt in range(2):
            slopes = pushes_well == (attempt == 0)
            if slopes:
                dx, dy, dz = slope_step(
                    fx, fy, fz, mx, my, mz, cx, cy, cz, gx, gy, gz, hxx, hyy, hzz, hxy, hxz, hyz
                )
            else:
                det = push * push + xi * xi * (waa * wbb - wab * wab)
                va = (xi * wbb * fa - (push + xi * wab) * fb) / det
                vb = (xi * waa * fb + (push - xi * wab) * fa) / det
                dx, dy, dz = va * ax + vb * bx, va * ay + vb * by, va * az + vb * bz
            scale = min(1.0, 2.0 * reach / sqrt(dx * dx + dy * dy + dz * dz))
            for _ in range(_HALVINGS if attempt == 1 else _FIRST_HALVINGS):
                x, y, z = cx + scale * dx, cy + scale * dy, cz + scale * dz
                scale *= 0.5
                if slopes:
                    new = line_entry(size, gauge, inner, reach, fx, fy, fz, x, y, z)
                else:
                    new = ray_entry(size, gauge, inner, x, y, z)
                if new[0]:
                    quantities = tangent_quantities(
                        fx,
                        fy,
                        fz,
                        mx,
                        my,
                        mz,
                        new[1],
                        new[2],
                        new[3],
                        new[4],
                        new[5],
                        new[6],
                        new[7],
                        new[8],
                        new[9],
                        new[10],
                        new[11],
                        new[12],
                    )
                    new_squared_residual = quantities[9] * quantities[9] + quantities[10] * quantities[10]
                    if quantities[15] < 0.0 and new_squared_residual < squared_residual:
                        improved = True
                        squared_residual = new_squared_residual
                        hit, cx, cy, cz, gx, gy, gz, hxx, hyy, hzz, hxy, hxz, hyz = new
                        nx, ny, nz, ax, ay, az, bx, by, bz, fa, fb, waa, wab, wbb, xi, push = quantities
                        break
            if improved:
                break
    t = invariant(fx, fy, fz, mx, my, mz)
    det = waa * wbb - wab * wab
    converged = hit and squared_residual <= 1e4 * tolerance and is_contact(t, xi, push, det)
    if push * push > 1e-3 * force * force:
        xi = t / push
    return converged, step, cx, cy, cz, nx, ny, nz, xi, waa + wbb, det
