"""How well contacts at fixed places explain a measurement: the search where the measurement says little.

Where the place is open by more than a few centimetres, no line tells where to look and one optimum does not
stand for the answer. Every place of `contactsense.places` is tried instead, and the sum over them is the
integral over the surface. The unknowns at a place are the logarithm phi of the normal force F, the force's
lean (alpha, beta)
and the lever chi of the torsion, both in units of the normal force, and a shift (v1, v2) within the cell:

    f = F (-n + alpha t1 + beta t2),    m = c x f + F chi n,    c = c0 + v1 t1 + v2 t2

In these all priors are normal distributions (that of the lean Student's), so that a measurement which says
nothing leaves just them. Laplace's integral over the six gives the evidence of the cell. All is
done in the axes (n, t1, t2) with the origin c0, where the wrench and its derivatives are mostly zeros:

    f = F (-1, alpha, beta),    m = F (chi + beta v1 - alpha v2, -v2, v1)
"""

import math

from contactsense.energy import TAIL, tangents
from contactsense.ldl import solve
from contactsense.view import view
from robots.compiled import fused_kernel

STEPS = 6
"""Most Gauss-Newton steps at one place."""
ENOUGH = 0.05
"""A step that promises less gain than this ends the search at a place."""
STEEPEST = 0.3
"""Least normal force that a search starts with, as a part of the measured force."""
WEAKEST = 1e-3
"""The same, in units of the usual normal force."""
LONGEST = 1.5
"""Longest step in the logarithm of the force."""


@fused_kernel
def weigh(w, L, prior, cx, cy, cz, nx, ny, nz, spread, known, limit, work):  # type: ignore[no-untyped-def]
    """Evidence of a contact in one cell.

    Args:
        w, L: Fused wrench and its information matrix, link frame, shapes (6,) and (6, 6).
        prior: What is known of contacts beforehand.
        cx, cy, cz, nx, ny, nz: Place [m] and outward unit normal, link frame.
        spread: Standard deviation of the cell along each tangent [m].
        known: Whether the force was measured: the search starts with it.
        limit: Energy above which the place is of no interest.
        work: Scratch.

    Returns:
        Energy; log of the mean evidence over the cell (up to the noise's own constant; -infinity beyond the
        limit), the most probable place in the cell (3) [m], its mean variance along the tangents [m^2], and
        force (3) [N].
    """
    T, A, H, g = work.frame, work.columns, work.normal_equations, work.gradient
    T[0, 0], T[1, 0], T[2, 0] = nx, ny, nz
    T[0, 1], T[1, 1], T[2, 1], T[0, 2], T[1, 2], T[2, 2] = tangents(nx, ny, nz)
    view(w, L, T, (cx, cy, cz), g, A, work)
    w0, w1, w2, w3, w4, w5 = g[0], g[1], g[2], g[3], g[4], g[5]
    # The search starts at the measured force, if there is one, else at a usual one.
    least = max(STEEPEST * math.sqrt(w0 * w0 + w1 * w1 + w2 * w2), WEAKEST * prior.force)
    F = max(-w0, least) if known else prior.force
    phi, chi, v1, v2 = math.log(F / prior.force), 0.0, 0.0, 0.0
    alpha, beta = (w1 / F, w2 / F) if known else (0.0, 0.0)
    lean, lever, cell = 1.0 / prior.lean**2, 1.0 / prior.lever**2, 1.0 / spread**2
    energy, log_det, v11, v22 = math.inf, math.inf, 0.0, 0.0
    for step in range(STEPS + 1):
        F = prior.force * math.exp(phi)
        # The contact's wrench, and by how much it misses the measured one.
        f0, f1, f2 = -F, F * alpha, F * beta
        m0, m1, m2 = F * (chi + beta * v1 - alpha * v2), -F * v2, F * v1
        d0, d1, d2, d3, d4, d5 = f0 - w0, f1 - w1, f2 - w2, m0 - w3, m1 - w4, m2 - w5
        y0, y1, y2, y3, y4, y5 = _times(A, d0, d1, d2, d3, d4, d5)
        z0, z1, z2, z3, z4, z5 = _times(A, f0, f1, f2, m0, m1, m2)
        rho = (alpha * alpha + beta * beta) * lean
        tail = (TAIL + 2.0) / (TAIL + rho)
        energy = 0.5 * (
            (d0 * y0 + d1 * y1 + d2 * y2 + d3 * y3 + d4 * y4 + d5 * y5)
            + phi * phi
            + (TAIL + 2.0) * math.log(1.0 + rho / TAIL)
            + chi * chi * lever
            + (v1 * v1 + v2 * v2) * cell
        )
        # Derivatives of the wrench over F, rows (f0, f1, f2, m0, m1, m2): by alpha (0, 1, 0, -v2, 0, 0), by
        # beta (0, 0, 1, v1, 0, 0), by chi (0, 0, 0, 1, 0, 0), by v1 (0, 0, 0, beta, 0, 1), by v2 (0, 0, 0,
        # -alpha, -1, 0).
        g[0] = f0 * y0 + f1 * y1 + f2 * y2 + m0 * y3 + m1 * y4 + m2 * y5 + phi
        g[1] = F * (y1 - v2 * y3) + tail * alpha * lean
        g[2] = F * (y2 + v1 * y3) + tail * beta * lean
        g[3] = F * y3 + chi * lever
        g[4] = F * (beta * y3 + y5) + v1 * cell
        g[5] = -F * (alpha * y3 + y4) + v2 * cell
        FF = F * F
        a3, a4, a5 = A[1, 3] - v2 * A[3, 3], A[1, 4] - v2 * A[3, 4], A[1, 5] - v2 * A[3, 5]
        b3, b4, b5 = A[2, 3] + v1 * A[3, 3], A[2, 4] + v1 * A[3, 4], A[2, 5] + v1 * A[3, 5]
        p3, p4, p5 = beta * A[3, 3] + A[3, 5], beta * A[3, 4] + A[4, 5], beta * A[3, 5] + A[5, 5]
        q3, q4 = -alpha * A[3, 3] - A[3, 4], -alpha * A[3, 4] - A[4, 4]
        H[0, 0] = f0 * z0 + f1 * z1 + f2 * z2 + m0 * z3 + m1 * z4 + m2 * z5 + 1.0
        H[0, 1] = F * (z1 - v2 * z3)
        H[0, 2] = F * (z2 + v1 * z3)
        H[0, 3] = F * z3
        H[0, 4] = F * (beta * z3 + z5)
        H[0, 5] = -F * (alpha * z3 + z4)
        H[1, 1] = FF * (A[1, 1] - v2 * (A[1, 3] + a3)) + tail * lean
        H[1, 2] = FF * (A[1, 2] - v2 * A[2, 3] + v1 * a3)
        H[1, 3] = FF * a3
        H[1, 4] = FF * (beta * a3 + a5)
        H[1, 5] = -FF * (alpha * a3 + a4)
        H[2, 2] = FF * (A[2, 2] + v1 * (A[2, 3] + b3)) + tail * lean
        H[2, 3] = FF * b3
        H[2, 4] = FF * (beta * b3 + b5)
        H[2, 5] = -FF * (alpha * b3 + b4)
        H[3, 3] = FF * A[3, 3] + lever
        H[3, 4] = FF * p3
        H[3, 5] = FF * q3
        H[4, 4] = FF * (beta * p3 + p5) + cell
        H[4, 5] = -FF * (alpha * p3 + p4)
        H[5, 5] = -FF * (alpha * q3 + q4) + cell
        log_det, hope, v11, _, v22 = solve(H, g)
        if log_det == math.inf or hope < ENOUGH or step == STEPS or energy - 2.0 * hope > limit:
            break
        # The equations are bilinear in the force and the rest: a long step in the force is shortened.
        scale = min(1.0, LONGEST / max(abs(g[0]), 1e-300))
        phi -= scale * g[0]
        alpha -= scale * g[1]
        beta -= scale * g[2]
        chi -= scale * g[3]
        v1 -= scale * g[4]
        v2 -= scale * g[5]
    px, py, pz = _turned(T, 0.0, v1, v2)
    fx, fy, fz = _turned(T, -F, F * alpha, F * beta)
    if log_det == math.inf or energy > limit:
        return math.inf, -math.inf, cx + px, cy + py, cz + pz, 0.0, fx, fy, fz
    log_z = -energy - 0.5 * log_det - math.log(prior.lean**2 * prior.lever * spread**2)
    return energy, log_z, cx + px, cy + py, cz + pz, 0.5 * (v11 + v22), fx, fy, fz


@fused_kernel
def _times(A, a, b, c, d, e, f):  # type: ignore[no-untyped-def]
    """A times (a, b, c, d, e, f), A symmetric, its upper triangle used."""
    return (
        A[0, 0] * a + A[0, 1] * b + A[0, 2] * c + A[0, 3] * d + A[0, 4] * e + A[0, 5] * f,
        A[0, 1] * a + A[1, 1] * b + A[1, 2] * c + A[1, 3] * d + A[1, 4] * e + A[1, 5] * f,
        A[0, 2] * a + A[1, 2] * b + A[2, 2] * c + A[2, 3] * d + A[2, 4] * e + A[2, 5] * f,
        A[0, 3] * a + A[1, 3] * b + A[2, 3] * c + A[3, 3] * d + A[3, 4] * e + A[3, 5] * f,
        A[0, 4] * a + A[1, 4] * b + A[2, 4] * c + A[3, 4] * d + A[4, 4] * e + A[4, 5] * f,
        A[0, 5] * a + A[1, 5] * b + A[2, 5] * c + A[3, 5] * d + A[4, 5] * e + A[5, 5] * f,
    )


@fused_kernel
def _turned(T, a, b, c):  # type: ignore[no-untyped-def]
    """T times (a, b, c)."""
    return (
        T[0, 0] * a + T[0, 1] * b + T[0, 2] * c,
        T[1, 0] * a + T[1, 1] * b + T[1, 2] * c,
        T[2, 0] * a + T[2, 1] * b + T[2, 2] * c,
    )
