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

from contactsense.view import about
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

    local: np.ndarray
    """Information matrix about the contact point, shape (6, 6)."""
    normal_equations: np.ndarray
    """Upper triangle: Gauss-Newton matrix of (f, xi, v1, v2), shape (6, 6)."""
    gradient: np.ndarray
    """Gradient of the energy, then the step, shape (6,)."""
    frame: np.ndarray
    """Columns: outward normal and two tangents, body axes, shape (3, 3)."""
    columns: np.ndarray
    """Rows: change of the wrench by each unknown at a fixed place, shape (6, 6)."""
    lever: np.ndarray
    """Columns: change of the moment about c by xi, v1, v2, body axes, shape (3, 3)."""


def empty_work() -> Work:
    """Scratch for one thread."""
    return Work(
        local=np.zeros((6, 6)),
        normal_equations=np.zeros((6, 6)),
        gradient=np.zeros(6),
        frame=np.zeros((3, 3)),
        columns=np.zeros((6, 6)),
        lever=np.zeros((3, 3)),
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
    frame, B, A, H, g = work.frame, work.lever, work.local, work.normal_equations, work.gradient
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
    B[0, 0], B[1, 0], B[2, 0] = nx, ny, nz
    B[0, 1] = t1y * fz - t1z * fy + xi * w1x
    B[1, 1] = t1z * fx - t1x * fz + xi * w1y
    B[2, 1] = t1x * fy - t1y * fx + xi * w1z
    B[0, 2] = t2y * fz - t2z * fy + xi * w2x
    B[1, 2] = t2z * fx - t2x * fz + xi * w2y
    B[2, 2] = t2x * fy - t2y * fx + xi * w2z
    about(L, cx, cy, cz, A)
    # The surface's offset loosens it. u is a pure moment, so that v = L u becomes X^T v about c.
    v, s, _ = loose
    v = (
        v[0] + v[4] * cz - v[5] * cy,
        v[1] + v[5] * cx - v[3] * cz,
        v[2] + v[3] * cy - v[4] * cx,
        v[3],
        v[4],
        v[5],
    )
    for i in range(6):
        for k in range(6):
            A[i, k] -= s * v[i] * v[k]
    # Residual wrench about c.
    dx, dy, dz = fx - w[0], fy - w[1], fz - w[2]
    d = (
        dx,
        dy,
        dz,
        xi * nx - w[3] + cy * w[2] - cz * w[1],
        xi * ny - w[4] + cz * w[0] - cx * w[2],
        xi * nz - w[5] + cx * w[1] - cy * w[0],
    )
    # H = G^T A G and g = G^T A d with G = diag(1, B).
    for i in range(6):
        p = (
            A[i, 0] * d[0]
            + A[i, 1] * d[1]
            + A[i, 2] * d[2]
            + A[i, 3] * d[3]
            + A[i, 4] * d[4]
            + A[i, 5] * d[5]
        )
        if i < 3:
            g[i] = p
            for k in range(3):
                H[i, k] = A[i, k]
                H[i, k + 3] = A[i, 3] * B[0, k] + A[i, 4] * B[1, k] + A[i, 5] * B[2, k]
        else:
            for k in range(3):
                # Row i of (moment block) B; kept where H's lower right block goes, and multiplied from the
                # left below.
                H[i, k] = A[i, 3] * B[0, k] + A[i, 4] * B[1, k] + A[i, 5] * B[2, k]
            g[i] = p
    g3, g4, g5 = g[3], g[4], g[5]
    for k in range(3):
        g[k + 3] = B[0, k] * g3 + B[1, k] * g4 + B[2, k] * g5
        for i in range(3):
            H[i + 3, k + 3] = B[0, i] * H[3, k] + B[1, i] * H[4, k] + B[2, i] * H[5, k]
    # Priors. Torsion ratio xi / (lever F) and lean (t . f) / (lean F), F = -n . f the normal force; their
    # derivatives
    # by (f, xi, v), where dF = -n . df - sum_a f_a k_ai dv_i and the tangents turn by k_ai F dv_i.
    F = -(fx * nx + fy * ny + fz * nz)
    f1 = t1x * fx + t1y * fy + t1z * fz
    f2 = t2x * fx + t2y * fy + t2z * fz
    F1 = -(f1 * k11 + f2 * k12)
    F2 = -(f1 * k12 + f2 * k22)
    i = 1.0 / (prior.lever * F)
    r = xi * i
    q = r / F
    _add_prior(H, g, r, (q * nx, q * ny, q * nz, i, -q * F1, -q * F2))
    i = 1.0 / F
    _add_prior(H, g, math.log(F / prior.force), (-i * nx, -i * ny, -i * nz, 0.0, i * F1, i * F2))
    # The heavy tail's weight: what a quadratic would have to be multiplied by to have the same slope here.
    weight = math.sqrt((TAIL + 2.0) / (TAIL + (f1 * f1 + f2 * f2) / (prior.lean * F) ** 2))
    i = weight / (prior.lean * F)
    r = f1 * i
    q = r / F
    row = (
        t1x * i + q * nx,
        t1y * i + q * ny,
        t1z * i + q * nz,
        0.0,
        k11 * F * i - q * F1,
        k12 * F * i - q * F2,
    )
    _add_prior(H, g, r, row)
    r = f2 * i
    q = r / F
    row = (
        t2x * i + q * nx,
        t2y * i + q * ny,
        t2z * i + q * nz,
        0.0,
        k12 * F * i - q * F1,
        k22 * F * i - q * F2,
    )
    _add_prior(H, g, r, row)


@fused_kernel
def _add_prior(H, g, r, row):  # type: ignore[no-untyped-def]
    """Add a squared residual r with the given derivatives to the upper triangle of H and to g."""
    for i in range(6):
        g[i] += r * row[i]
        for k in range(i, 6):
            H[i, k] += row[i] * row[k]
