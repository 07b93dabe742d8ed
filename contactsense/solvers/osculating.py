"""Iteration on any smooth convex body: the closed-form contact on the osculating ellipsoid.

Divided by the body's extent (x = (c - inner) / extent) a wrench is u, v as on the unit sphere
(`contactsense.solvers.ellipsoid`). Let N be the body's gauge about the inner point, homogeneous of degree one
and 1 on the surface. At any x the quadratic form Q = hess (N^2 / 2) is that of an ellipsoid about the inner
point that has the surface's gradient and curvature there. Its contact obeys v = K Q x + x x u, so with
D^2 = det Q

    (K D)^2 - l^2 = v . adj(Q) v - u . Q u,      K l = -u . v,      l = -u . Q x

    x = (K adj(Q) v + (Q u) x v - l u) / ((K D)^2 + u . Q u)

and both K D and l come from the branch that adds. The ray through it meets the surface at the next x. On an
ellipsoid the first step ends; near the contact on any body the steps converge quadratically, and far from it
they know that a body has another side, which Newton's linear ones do not.
"""

from math import inf, sqrt
from typing import Any

from contactsense.solvers.implicit_surfaces import evaluate
from contactsense.solvers.initial_guess import initial_guess, warped_step
from contactsense.solvers.level_set import Point, tangent_quantities
from contactsense.solvers.solution import invariant, is_contact
from contactsense.solvers.typed_kernel import kernel

_STEPS = 12
"""Beyond these it is quicker to search carefully."""

_BENDS = 5
"""Steps that follow the body's own bend; later ones are Newton's, which converge quadratically."""

_ON = 1e-9
"""How far beside the surface, relative to its distance, the square no longer counts."""


@kernel
def osculate(
    qxx: float,
    qyy: float,
    qzz: float,
    qxy: float,
    qxz: float,
    qyz: float,
    ux: float,
    uy: float,
    uz: float,
    vx: float,
    vy: float,
    vz: float,
) -> tuple[bool, float, float, float]:
    """Contact on the ellipsoid x . Q x = 1, up to its size.

    Args:
        qxx, qyy, qzz, qxy, qxz, qyz: Q.
        ux, uy, uz, vx, vy, vz: The wrench.

    Returns:
        Whether there is one, and x, y, z.
    """
    axx, ayy, azz = qyy * qzz - qyz * qyz, qxx * qzz - qxz * qxz, qxx * qyy - qxy * qxy
    axy, axz, ayz = qxz * qyz - qxy * qzz, qxy * qyz - qxz * qyy, qxy * qxz - qxx * qyz
    det = max(qxx * axx + qxy * axy + qxz * axz, 0.0)
    px, py, pz = (
        qxx * ux + qxy * uy + qxz * uz,
        qxy * ux + qyy * uy + qyz * uz,
        qxz * ux + qyz * uy + qzz * uz,
    )
    wx, wy, wz = (
        axx * vx + axy * vy + axz * vz,
        axy * vx + ayy * vy + ayz * vz,
        axz * vx + ayz * vy + azz * vz,
    )
    uu = ux * px + uy * py + uz * pz
    tau = ux * vx + uy * vy + uz * vz
    square = det * tau * tau
    sigma = vx * wx + vy * wy + vz * wz - uu
    large = 0.5 * (sqrt(sigma * sigma + 4.0 * square) + abs(sigma))
    share = 1.0 / large
    if sigma < 0.0:
        ll, kk = large, square * share
        l = sqrt(ll)  # noqa: E741
        across = -tau * l * share
    elif square > 0.0:
        ll, kk = square * share, large
        l = sqrt(ll)  # noqa: E741
        across = -tau / l
    else:
        return False, 0.0, 0.0, 0.0
    inverse = 1.0 / (kk + uu)
    return (
        True,
        (across * wx + (py * vz - pz * vy) - l * ux) * inverse,
        (across * wy + (pz * vx - px * vz) - l * uy) * inverse,
        (across * wz + (px * vy - py * vx) - l * uz) * inverse,
    )


@kernel
def gauge_at(size: Any, gauge: bool, inner: Point, extent: Point, x: float, y: float, z: float) -> Any:
    """The body's gauge on the ray through x, in units of its extent about the inner point.

    A function that is not a gauge is followed to the surface by its second order. Its level set has the
    gauge's gradient g / (g . x), and the Hessian there is its own, pulled back along the ray.

    Returns:
        Whether the ray meets the surface, the point there (3), gradient (3) and Q (6), how far beside the
        surface the function was taken.
    """
    a, b, c = extent
    level = evaluate(size, inner[0] + a * x, inner[1] + b * y, inner[2] + c * z)
    gx, gy, gz = a * level[1], b * level[2], c * level[3]
    hxx, hyy, hzz = a * a * level[4], b * b * level[5], c * c * level[6]
    hxy, hxz, hyz = a * b * level[7], a * c * level[8], b * c * level[9]
    if gauge:
        s = 1.0 + level[0]
        i = 1.0 / s
        return (
            s > 0.0,
            i * x,
            i * y,
            i * z,
            gx,
            gy,
            gz,
            gx * gx + s * hxx,
            gy * gy + s * hyy,
            gz * gz + s * hzz,
            gx * gy + s * hxy,
            gx * gz + s * hxz,
            gy * gz + s * hyz,
            0.0,
        )
    kx, ky, kz = hxx * x + hxy * y + hxz * z, hxy * x + hyy * y + hyz * z, hxz * x + hyz * y + hzz * z
    rise, curl = gx * x + gy * y + gz * z, kx * x + ky * y + kz * z
    root = rise * rise - 2.0 * level[0] * curl
    e = min(max(-2.0 * level[0] / (rise + sqrt(root)), -0.9), 20.0) if root > 0.0 else 0.0
    s = 1.0 + e
    x, y, z, gx, gy, gz = s * x, s * y, s * z, gx + e * kx, gy + e * ky, gz + e * kz
    i = 1.0 / (gx * x + gy * y + gz * z)
    gx, gy, gz, kx, ky, kz = i * gx, i * gy, i * gz, i * s * kx, i * s * ky, i * s * kz
    w = 1.0 + kx * x + ky * y + kz * z
    return (
        root > 0.0 and 0.0 < i < inf,
        x,
        y,
        z,
        gx,
        gy,
        gz,
        i * hxx - 2.0 * kx * gx + w * gx * gx,
        i * hyy - 2.0 * ky * gy + w * gy * gy,
        i * hzz - 2.0 * kz * gz + w * gz * gz,
        i * hxy - kx * gy - ky * gx + w * gx * gy,
        i * hxz - kx * gz - kz * gx + w * gx * gz,
        i * hyz - ky * gz - kz * gy + w * gy * gz,
        abs(e),
    )


@kernel
def osculating_iteration(
    size: Any,
    gauge: bool,
    inner: Point,
    extent: Point,
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
) -> tuple[bool, int, float, float, float, float, float, float, float, float, float]:
    """Iterate over osculating ellipsoids.

    There is no safeguard: if it does not converge within a few steps, `newton_iteration` is used.

    Args:
        size, gauge: The body.
        inner: A point well inside.
        extent: Half its size along each axis.
        fx, fy, fz, mx, my, mz: Wrench.

    Returns:
        As `newton_iteration`; the last point if it did not converge.
    """
    a, b, c = extent
    ix, iy, iz = inner
    ux, uy, uz = b * c * fx, c * a * fy, a * b * fz
    vx, vy, vz = (
        a * (mx - (iy * fz - iz * fy)),
        b * (my - (iz * fx - ix * fz)),
        c * (mz - (ix * fy - iy * fx)),
    )
    tau = abs(ux * vx + uy * vy + uz * vz)
    # Rounding error of the moment, squared.
    lx = a * (abs(mx) + abs(iy * fz) + abs(iz * fy))
    ly = b * (abs(my) + abs(iz * fx) + abs(ix * fz))
    lz = c * (abs(mz) + abs(ix * fy) + abs(iy * fx))
    tolerance = 16e-32 * (lx * lx + ly * ly + lz * lz + 4.0 * (ux * ux + uy * uy + uz * uz))
    x, y, z = initial_guess(size, ux, uy, uz, vx, vy, vz)
    previous = inf
    step = 0
    while True:
        there, x, y, z, gx, gy, gz, qxx, qyy, qzz, qxy, qxz, qyz, off = gauge_at(
            size, gauge, inner, extent, x, y, z
        )
        if not there:
            break
        push = ux * gx + uy * gy + uz * gz
        rx, ry, rz = vx - (y * uz - z * uy), vy - (z * ux - x * uz), vz - (x * uy - y * ux)
        # Tangential moment, times the norm of the gradient.
        ex, ey, ez = ry * gz - rz * gy, rz * gx - rx * gz, rx * gy - ry * gx
        squared_residual = ex * ex + ey * ey + ez * ez
        limit = tolerance * (gx * gx + gy * gy + gz * gz)
        converged = squared_residual <= limit or (
            squared_residual <= 1e4 * limit and squared_residual > 0.25 * previous
        )
        if push < 0.0 and off < _ON and converged:
            cx, cy, cz = ix + a * x, iy + b * y, iz + c * z
            ia, ib, ic = 1.0 / a, 1.0 / b, 1.0 / c
            # Along the tangents Q is the gauge's own Hessian.
            nx, ny, nz, ax, ay, az, bx, by, bz, fa, fb, waa, wab, wbb, xi, fn = tangent_quantities(
                fx,
                fy,
                fz,
                mx,
                my,
                mz,
                cx,
                cy,
                cz,
                ia * gx,
                ib * gy,
                ic * gz,
                ia * ia * qxx,
                ib * ib * qyy,
                ic * ic * qzz,
                ia * ib * qxy,
                ia * ic * qxz,
                ib * ic * qyz,
            )
            t = invariant(fx, fy, fz, mx, my, mz)
            det = waa * wbb - wab * wab
            found = is_contact(t, xi, fn, det)
            # One Newton step: rounding errors of Q, which grow with the exponent, do not enter it.
            inverse = 1.0 / (fn * fn + xi * xi * det)
            va = (xi * wbb * fa - (fn + xi * wab) * fb) * inverse
            vb = (xi * waa * fb + (fn - xi * wab) * fa) * inverse
            wa, wb = waa * va + wab * vb, wab * va + wbb * vb
            px, py, pz = cx + va * ax + vb * bx, cy + va * ay + vb * by, cz + va * az + vb * bz
            ex, ey, ez = nx + wa * ax + wb * bx, ny + wa * ay + wb * by, nz + wa * az + wb * bz
            rx, ry, rz = mx - (py * fz - pz * fy), my - (pz * fx - px * fz), mz - (px * fy - py * fx)
            sx, sy, sz = ey * rz - ez * ry, ez * rx - ex * rz, ex * ry - ey * rx
            if sx * sx + sy * sy + sz * sz < fa * fa + fb * fb:
                cx, cy, cz, nx, ny, nz = px, py, pz, ex, ey, ez
                xi, fn = ex * rx + ey * ry + ez * rz, ex * fx + ey * fy + ez * fz
            if fn * fn > 1e-3 * (fx * fx + fy * fy + fz * fz):
                xi = t / fn
            return found, step, cx, cy, cz, nx, ny, nz, xi, waa + wbb, det
        if step == _STEPS:
            break
        previous = squared_residual
        there, px, py, pz = osculate(qxx, qyy, qzz, qxy, qxz, qyz, ux, uy, uz, vx, vy, vz)
        if not there:
            break
        step += 1
        if step <= _BENDS:
            gx, gy, gz = (
                qxx * px + qxy * py + qxz * pz,
                qxy * px + qyy * py + qyz * pz,
                qxz * px + qyz * py + qzz * pz,
            )
            x, y, z = warped_step(size, tau, ux, uy, uz, x, y, z, px, py, pz, gx, gy, gz)
        else:
            x, y, z = px, py, pz
    return False, step, ix + a * x, iy + b * y, iz + c * z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
