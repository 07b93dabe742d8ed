"""Maximum a posteriori contact on one primitive (theory, section 5), by Gauss-Newton on the surface.

The unknowns are the force f (3), the torsion xi and the place c on the surface (2). With the fused wrench w_k
and its information matrix L of the link's hypothesis, and d = (f, c x f + xi n) - w_k, the energy is

    E = 1/2 d^T L' d  +  1/2 (xi / (lever |f_n|))^2  +  (nu + 2)/2 log(1 + rho^2 / nu)  +  1/2 log(|f_n| /
    F)^2

with rho = |f_t| / (lean |f_n|).

The second term says how much torsion a contact patch can carry, the third how far friction lets a force lean:
a force spread evenly over the friction disc has the standard deviation lean = mu / 2 in each tangent
direction. Its distribution is Student's, whose heavy tail allows for what the primitives do not show: ribs,
steps and screw heads, on which the real normal is another. The last term says which forces are common: the
normal force is log-normal about F with a factor of e as its standard deviation, which matters only where the
sensors leave its size open. L' is L made looser by what is not known of the
surface's place: an offset of standard deviation s along the normal adds s^2 u u^T to the covariance, u = (0,
n x f). The 6x6 matrix of the search gives the curvature of the optimum: covariance and evidence (Laplace).
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.square import add_slope, add_square
from contactsense.view import about, blocks, dot, times
from robots.compiled import fused_kernel, inlined_fused_kernel

TAIL = 4.0
"""Degrees of freedom of the distribution of a force's lean: few of them make great leans improbable, not
impossible."""
LEAST_FORCE = 1e-3
"""Force that a search starts with where the fused wrench has none [N]."""


class Prior(NamedTuple):
    """What is known of contacts before any measurement."""

    lean: float
    """Standard deviation of tangential over normal force, each tangent direction; half the friction
    coefficient."""
    lever: float
    """Standard deviation of torsion over normal force [m]."""
    offset: float
    """Standard deviation of the real surface's offset from the primitive [m]."""
    force: float
    """Median of the normal force [N]; its logarithm has the standard deviation 1."""
    room: float
    """Room above a place that whatever touches it needs [m]."""
    area: float
    """Area of the touchable surface, on which every place is as likely [m^2]."""


class Work(NamedTuple):
    """Scratch arrays of `refine`, and its matrix results."""

    normal_equations: np.ndarray
    """Upper triangle: Gauss-Newton matrix of (f, xi, v1, v2), shape (6, 6)."""
    gradient: np.ndarray
    """Gradient of the energy, then the step, shape (6,)."""
    frame: np.ndarray
    """Columns: outward normal and two tangents, body axes, shape (3, 3)."""


def empty_work() -> Work:
    """Scratch for one thread."""
    return Work(
        normal_equations=np.zeros((6, 6)),
        gradient=np.zeros(6),
        frame=np.zeros((3, 3)),
    )


@fused_kernel
def loosen(L, prior, nx, ny, nz, fx, fy, fz):  # type: ignore[no-untyped-def]
    """How the surface's offset loosens the information: L' = L - s^2 v v^T / widen, v = L u, widen = 1 + s^2
    u . v.

    Returns:
        v (6 floats, one tuple), s^2 / widen, and widen.
    """
    ux, uy, uz = ny * fz - nz * fy, nz * fx - nx * fz, nx * fy - ny * fx
    v = (
        L[0, 3] * ux + L[0, 4] * uy + L[0, 5] * uz,
        L[1, 3] * ux + L[1, 4] * uy + L[1, 5] * uz,
        L[2, 3] * ux + L[2, 4] * uy + L[2, 5] * uz,
        L[3, 3] * ux + L[3, 4] * uy + L[3, 5] * uz,
        L[4, 3] * ux + L[4, 4] * uy + L[4, 5] * uz,
        L[5, 3] * ux + L[5, 4] * uy + L[5, 5] * uz,
    )
    s = prior.offset * prior.offset
    widen = 1.0 + s * (ux * v[3] + uy * v[4] + uz * v[5])
    return v, s / widen, widen


@fused_kernel
def log_prior(prior, push):  # type: ignore[no-untyped-def]
    """Log of the priors' density at its peak for a normal force `push` [N], times (2 pi)^3 for Laplace's
    integral over force, torsion and place."""
    return math.log(2.0 * math.pi / (prior.lean * prior.lean * prior.lever * prior.area)) - 4.0 * math.log(
        push
    )


@fused_kernel
def energy_at(w, L, prior, loose, cx, cy, cz, nx, ny, nz, fx, fy, fz, xi):  # type: ignore[no-untyped-def]
    """Energy of a contact; `loose` is what `loosen` says, infinite where the force does not push."""
    push = -(fx * nx + fy * ny + fz * nz)
    if push <= 0.0:
        return math.inf
    d = (
        fx - w[0],
        fy - w[1],
        fz - w[2],
        cy * fz - cz * fy + xi * nx - w[3],
        cz * fx - cx * fz + xi * ny - w[4],
        cx * fy - cy * fx + xi * nz - w[5],
    )
    v, s, _ = loose
    dLd = 0.0
    vd = 0.0
    for i in range(6):
        Ld = (
            L[i, 0] * d[0]
            + L[i, 1] * d[1]
            + L[i, 2] * d[2]
            + L[i, 3] * d[3]
            + L[i, 4] * d[4]
            + L[i, 5] * d[5]
        )
        dLd += d[i] * Ld
        vd += v[i] * d[i]
    twist = xi / (prior.lever * push)
    lean = (fx * fx + fy * fy + fz * fz - push * push) / (prior.lean * push) ** 2
    size = math.log(push / prior.force)
    return 0.5 * (
        dLd - s * vd * vd + twist * twist + size * size + (TAIL + 2.0) * math.log(1.0 + lean / TAIL)
    )


@fused_kernel
def lean_in(fx, fy, fz, nx, ny, nz):  # type: ignore[no-untyped-def]
    """The force, turned into the surface as far as needed for the priors to be finite: a start for the
    search."""
    push = -(fx * nx + fy * ny + fz * nz)
    least = 0.1 * max(math.sqrt(fx * fx + fy * fy + fz * fz), LEAST_FORCE)
    lift = max(least - push, 0.0)
    return fx - lift * nx, fy - lift * ny, fz - lift * nz


@inlined_fused_kernel
def tangents(nx, ny, nz):  # type: ignore[no-untyped-def]
    """Two unit tangents, continuous but for one direction (Duff et al. 2017, "Building an orthonormal basis,
    revisited")."""
    sign = 1.0 if nz >= 0.0 else -1.0
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    return 1.0 + sign * nx * nx * a, sign * b, -sign * nx, b, sign + ny * ny * a, -ny


@fused_kernel
def set_up(w, L, prior, loose, W, cx, cy, cz, nx, ny, nz, fx, fy, fz, xi, work):  # type: ignore[no-untyped-def]
    """Fill gradient and Gauss-Newton matrix at one point of the search. W: shape operator, six floats."""
    t1x, t1y, t1z, t2x, t2y, t2z = tangents(nx, ny, nz)
    frame, H, g = work.frame, work.normal_equations, work.gradient
    frame[0, 0], frame[1, 0], frame[2, 0] = nx, ny, nz
    frame[0, 1], frame[1, 1], frame[2, 1] = t1x, t1y, t1z
    frame[0, 2], frame[1, 2], frame[2, 2] = t2x, t2y, t2z
    # How the normal turns with a step along each tangent, and the curvature in the tangent plane.
    w1x = W[0] * t1x + W[1] * t1y + W[2] * t1z
    w1y = W[1] * t1x + W[3] * t1y + W[4] * t1z
    w1z = W[2] * t1x + W[4] * t1y + W[5] * t1z
    w2x = W[0] * t2x + W[1] * t2y + W[2] * t2z
    w2y = W[1] * t2x + W[3] * t2y + W[4] * t2z
    w2z = W[2] * t2x + W[4] * t2y + W[5] * t2z
    k11 = t1x * w1x + t1y * w1y + t1z * w1z
    k12 = t1x * w2x + t1y * w2y + t1z * w2z
    k22 = t2x * w2x + t2y * w2y + t2z * w2z
    # Change of the moment about c by xi, v1, v2.
    b0 = (nx, ny, nz)
    b1 = (t1y * fz - t1z * fy + xi * w1x, t1z * fx - t1x * fz + xi * w1y, t1x * fy - t1y * fx + xi * w1z)
    b2 = (t2y * fz - t2z * fy + xi * w2x, t2z * fx - t2x * fz + xi * w2y, t2x * fy - t2y * fx + xi * w2z)
    # H = G^T A G and g = G^T A d with A the information about c, G = diag(1, (b0 b1 b2)) and d the residual
    # wrench about c.
    F, D, M = blocks(L)
    F, D, M = about(F, D, M, cx, cy, cz)
    p0, p1, p2 = times(M, b0), times(M, b1), times(M, b2)
    c0, c1, c2 = _transposed_times(D, b0), _transposed_times(D, b1), _transposed_times(D, b2)
    df = (fx - w[0], fy - w[1], fz - w[2])
    dm = (
        xi * nx - w[3] + cy * w[2] - cz * w[1],
        xi * ny - w[4] + cz * w[0] - cx * w[2],
        xi * nz - w[5] + cx * w[1] - cy * w[0],
    )
    af, am = times(F, df), times(D, df)
    bf, bm = _transposed_times(D, dm), times(M, dm)
    m = (am[0] + bm[0], am[1] + bm[1], am[2] + bm[2])
    # The surface's offset loosens it. u is a pure moment, so that v = L u becomes X^T v about c.
    v, s, _ = loose
    vf = (v[0] + v[4] * cz - v[5] * cy, v[1] + v[5] * cx - v[3] * cz, v[2] + v[3] * cy - v[4] * cx)
    vm = (v[3], v[4], v[5])
    free = (dot(b0, vm), dot(b1, vm), dot(b2, vm))
    a, b, c = s * vf[0], s * vf[1], s * vf[2]
    H[0, 0], H[0, 1], H[0, 2] = F[0][0] - a * vf[0], F[0][1] - a * vf[1], F[0][2] - a * vf[2]
    H[0, 3], H[0, 4], H[0, 5] = c0[0] - a * free[0], c1[0] - a * free[1], c2[0] - a * free[2]
    H[1, 1], H[1, 2] = F[1][1] - b * vf[1], F[1][2] - b * vf[2]
    H[1, 3], H[1, 4], H[1, 5] = c0[1] - b * free[0], c1[1] - b * free[1], c2[1] - b * free[2]
    H[2, 2] = F[2][2] - c * vf[2]
    H[2, 3], H[2, 4], H[2, 5] = c0[2] - c * free[0], c1[2] - c * free[1], c2[2] - c * free[2]
    a, b, c = s * free[0], s * free[1], s * free[2]
    H[3, 3], H[3, 4], H[3, 5] = (
        dot(b0, p0) - a * free[0],
        dot(b0, p1) - a * free[1],
        dot(b0, p2) - a * free[2],
    )
    H[4, 4], H[4, 5] = dot(b1, p1) - b * free[1], dot(b1, p2) - b * free[2]
    H[5, 5] = dot(b2, p2) - c * free[2]
    r = s * (dot(vf, df) + dot(vm, dm))
    g[0], g[1], g[2] = af[0] + bf[0] - r * vf[0], af[1] + bf[1] - r * vf[1], af[2] + bf[2] - r * vf[2]
    g[3], g[4], g[5] = dot(b0, m) - r * free[0], dot(b1, m) - r * free[1], dot(b2, m) - r * free[2]
    # Priors. Torsion ratio xi / (lever F) and lean (t . f) / (lean F), F = -n . f the normal force; their
    # derivatives
    # by (f, xi, v), where dF = -n . df - sum_a f_a k_ai dv_i and the tangents turn by k_ai F dv_i.
    push = -(fx * nx + fy * ny + fz * nz)
    f1 = t1x * fx + t1y * fy + t1z * fz
    f2 = t2x * fx + t2y * fy + t2z * fz
    F1 = -(f1 * k11 + f2 * k12)
    F2 = -(f1 * k12 + f2 * k22)
    inverse = 1.0 / push
    unit = inverse / prior.lever
    r1 = xi * unit
    q = r1 * inverse
    twist = (q * nx, q * ny, q * nz, unit, -q * F1, -q * F2)
    r2 = math.log(push / prior.force)
    size = (-inverse * nx, -inverse * ny, -inverse * nz, 0.0, inverse * F1, inverse * F2)
    # The heavy tail's weight: what a quadratic would have to be multiplied by to have the same slope here.
    unit = inverse / prior.lean
    unit *= math.sqrt((TAIL + 2.0) / (TAIL + (f1 * f1 + f2 * f2) * unit * unit))
    r3, r4 = f1 * unit, f2 * unit
    q = r3 * inverse
    lean1 = (
        t1x * unit + q * nx,
        t1y * unit + q * ny,
        t1z * unit + q * nz,
        0.0,
        k11 * push * unit - q * F1,
        k12 * push * unit - q * F2,
    )
    q = r4 * inverse
    lean2 = (
        t2x * unit + q * nx,
        t2y * unit + q * ny,
        t2z * unit + q * nz,
        0.0,
        k12 * push * unit - q * F1,
        k22 * push * unit - q * F2,
    )
    _add_prior(H, g, r1, twist)
    _add_prior(H, g, r2, size)
    _add_prior(H, g, r3, lean1)
    _add_prior(H, g, r4, lean2)


@fused_kernel
def _transposed_times(B, a):  # type: ignore[no-untyped-def]
    """B^T a, with B a block, a tuple of rows."""
    return (
        B[0][0] * a[0] + B[1][0] * a[1] + B[2][0] * a[2],
        B[0][1] * a[0] + B[1][1] * a[1] + B[2][1] * a[2],
        B[0][2] * a[0] + B[1][2] * a[1] + B[2][2] * a[2],
    )


@fused_kernel
def _add_prior(H, g, r, row):  # type: ignore[no-untyped-def]
    """Add a squared residual r with the given derivatives to the upper triangle of H and to g."""
    add_slope(g, r, row)
    add_square(H, 1.0, row)
