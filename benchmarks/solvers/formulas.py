"""The closed forms for any number type, and as the paper prints them.

The former work for arrays of any type for which numpy has sums and square roots, so the same code gives the
reference in extended precision for a million wrenches and with mpmath for a few. The latter are the paper's
own formulas in double precision, with only its misprints corrected.
"""

from typing import Any

import numpy as np

Vectors = Any
"""Array of three rows, shape (3, N): x, y, z."""


def dot(a: Vectors, b: Vectors) -> Any:
    """Inner products, shape (N,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vectors, b: Vectors) -> Any:
    """Cross products, shape (3, N)."""
    return np.stack((a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]))


def ellipsoid(f: Vectors, m: Vectors, a: Any, b: Any, c: Any) -> Vectors:
    """Contact centroids on an ellipsoid (section 5 of the paper); not for wrenches that miss or touch."""
    u = np.stack((b * c * f[0], c * a * f[1], a * b * f[2]))
    v = np.stack((a * m[0], b * m[1], c * m[2]))
    uu, vv, tau = dot(u, u), dot(v, v), dot(u, v)
    sigma = vv - uu
    rho = np.sqrt(sigma * sigma + 4 * tau * tau)
    large = np.sqrt((rho + abs(sigma)) / 2)
    small = abs(tau) / large
    k = np.where(sigma >= 0, large, small)
    length = np.where(sigma >= 0, small, large)
    k = np.where(tau > 0, -k, k)
    x = (k * v + cross(u, v) - length * u) / (k * k + uu)
    return np.stack((a * x[0], b * x[1], c * x[2]))


def cone(f: Vectors, m: Vectors, radius: Any, taper: Any) -> Vectors:
    """Contact centroids on a cylinder (no taper) or a cone about z."""
    px, py = radius * f[1] + taper * m[0], taper * m[1] - radius * f[0]
    pp = px * px + py * py
    along, across = m[2] / pp, np.sqrt(pp - m[2] * m[2]) / pp
    best: Any = None
    for sign in (-1, 1):
        ex, ey = along * px - sign * across * py, along * py + sign * across * px
        push = ex * f[0] + ey * f[1] + taper * f[2]
        z = (ex * m[1] - ey * m[0] + radius * f[2]) / push
        rho = radius - taper * z
        c = np.stack((rho * ex, rho * ey, z))
        good = (push < 0) & (rho > 0)
        best = c if best is None else np.where(good, c, best)
    return best


def plane(f: Vectors, m: Vectors, n: Vectors, offset: Any) -> Vectors:
    """Contact centroids on a plane with the normals `n`, shape (3, 1)."""
    return (cross(n, m) + offset * f) / dot(n, f)


def paraboloid(f: Vectors, m: Vectors, k1: Any, k2: Any) -> Vectors:
    """Contact centroids on z = -(k1 x^2 + k2 y^2) / 2; not for wrenches that miss or touch."""
    r1, r2 = np.sqrt(k1), np.sqrt(k2)
    u = np.stack((r1 * f[0], r2 * f[1], f[2]))
    v = np.stack((r2 * m[0], r1 * m[1], r1 * r2 * m[2]))
    tau = dot(u, v)
    real = u[2] * u[2] - v[2] * v[2] - 2 * (u[0] * v[1] - u[1] * v[0])
    large = np.sqrt((np.sqrt(real * real + 4 * tau * tau) + abs(real)) / 2)
    small = abs(tau) / large
    length = np.where(real > 0, large, small)
    k = np.where(real > 0, small, large)
    k = np.where(tau > 0, -k, k)
    # Twice the complex numbers i V / (L + W), or (L - W) / conj(A).
    add = k * v[2] >= length * u[2]
    re, im = np.where(add, u[2] - length, -length - u[2]), np.where(add, k + v[2], k - v[2])
    scale = 1 / np.where(add, (re * re + im * im) / 2, u[0] * u[0] + u[1] * u[1])
    x = scale * np.where(add, v[0] * im - v[1] * re, re * u[0] - im * u[1])
    y = scale * np.where(add, v[0] * re + v[1] * im, re * u[1] + im * u[0])
    return np.stack((x / r1, y / r2, -(x * x + y * y) / 2))


def printed_ellipsoid(f: Vectors, m: Vectors, a: float, b: float, c: float) -> Vectors:
    """The paper's (16) into its (14), with the wrench axis where f.m is zero."""
    A = np.array(((1.0 / a,), (1.0 / b,), (1.0 / c,)))
    D = 1.0 / (a * b * c)
    t = dot(f, m)
    sigma = D**2 * dot(m / A, m / A) - dot(A * f, A * f)
    K = -np.sign(t) / (np.sqrt(2.0) * D) * np.sqrt(sigma + np.sqrt(sigma**2 + 4.0 * D**2 * t**2))
    exact = (K**2 * D**2 * m / A**2 + K * cross(A**2 * f, m) + t * f) / (
        K * (K**2 * D**2 + dot(A * f, A * f))
    )
    r = cross(f, m) / dot(f, f)
    ar, af = A * r, A * f
    root = np.sqrt(dot(af, ar) ** 2 - dot(af, af) * (dot(ar, ar) - 1.0))
    axis = r + (-dot(af, ar) - root) / dot(af, af) * f
    return np.where(t == 0.0, axis, exact)


def printed_cylinder(f: Vectors, m: Vectors, radius: float) -> Vectors:
    """The paper's section 5.1.2, with the wrench axis where f.m is zero."""
    t = dot(f, m)
    across = np.stack((f[0], f[1], 0.0 * f[2]))
    along = np.stack((0.0 * m[0], 0.0 * m[1], m[2]))
    ff = dot(across, across)
    K = -t / np.sqrt(radius**2 * ff - m[2] ** 2)
    exact = (K**2 * along + K * cross(across, m) + t * f) / (K * ff)
    r = cross(f, m) / dot(f, f)
    fr = f[0] * r[0] + f[1] * r[1]
    root = np.sqrt(fr**2 - ff * (r[0] ** 2 + r[1] ** 2 - radius**2))
    axis = r + (-fr - root) / ff * f
    return np.where(t == 0.0, axis, exact)


def printed_plane(f: Vectors, m: Vectors, offset: float) -> Vectors:
    """The paper's section 5.1.3 for the plane z = offset, with its sign corrected."""
    g = np.stack((0.0 * f[0], 0.0 * f[1], f[2]))
    return (cross(g, m) - offset * abs(f[2]) * f) / f[2] ** 2
