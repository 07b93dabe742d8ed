"""How well contacts at fixed places explain a measurement: the search where the measurement says little.

Where the place is open by more than a few centimetres, no line tells where to look and one optimum does not
stand for the answer. Every place of `contactsense.places` is tried instead, and the sum over them is the
integral over the surface. The unknowns at a place are the logarithm phi of the normal force F, the force's
lean (alpha, beta)
and the lever chi of the torsion, both in units of the normal force, and a shift (v1, v2) within the cell:

    f = F (-n + alpha t1 + beta t2),    m = c x f + F chi n,    c = c0 + v1 t1 + v2 t2

In these all priors are normal distributions (that of the lean Student's), so that a measurement which says
nothing leaves just them. Laplace's integral over the six gives the evidence of the cell.
"""

import math

from contactsense.energy import TAIL, tangents
from contactsense.ldl import solve
from robots.compiled import fused_kernel

STEPS = 6
"""Most Gauss-Newton steps at one place."""
ENOUGH = 0.05
"""A step that promises less gain than this ends the search at a place."""
LONGEST = 1.5
"""Longest step in the logarithm of the force."""


@fused_kernel
def _moment_columns(J, k, cx, cy, cz, fx, fy, fz):  # type: ignore[no-untyped-def]
    """Row k of J: the wrench of a force at c."""
    J[k, 0], J[k, 1], J[k, 2] = fx, fy, fz
    J[k, 3], J[k, 4], J[k, 5] = cy * fz - cz * fy, cz * fx - cx * fz, cx * fy - cy * fx


@fused_kernel
def weigh(w, L, prior, cx, cy, cz, nx, ny, nz, spread, start, limit, work):  # type: ignore[no-untyped-def]
    """Evidence of a contact in one cell.

    Args:
        w, L: Fused wrench and its information matrix, link frame, shapes (6,) and (6, 6).
        prior: What is known of contacts beforehand.
        cx, cy, cz, nx, ny, nz: Place [m] and outward unit normal, link frame.
        spread: Standard deviation of the cell along each tangent [m].
        start: Normal force that the search starts with [N].
        limit: Energy above which the place is of no interest.
        work: Scratch.

    Returns:
        Energy; log of the mean evidence over the cell (up to the noise's own constant; -infinity beyond the
        limit), the most probable place in the cell (3) [m], its mean variance along the tangents [m^2], and
        force (3) [N].
    """
    t1x, t1y, t1z, t2x, t2y, t2z = tangents(nx, ny, nz)
    J, H, g, A = work.columns, work.normal_equations, work.gradient, work.local
    phi, alpha, beta, chi, v1, v2 = math.log(start / prior.force), 0.0, 0.0, 0.0, 0.0, 0.0
    lean, lever, cell = 1.0 / prior.lean**2, 1.0 / prior.lever**2, 1.0 / spread**2
    energy, log_det, v11, v22 = math.inf, math.inf, 0.0, 0.0
    px, py, pz, fx, fy, fz = cx, cy, cz, 0.0, 0.0, 0.0
    for step in range(STEPS + 1):
        F = prior.force * math.exp(phi)
        px, py, pz = cx + v1 * t1x + v2 * t2x, cy + v1 * t1y + v2 * t2y, cz + v1 * t1z + v2 * t2z
        fx = F * (alpha * t1x + beta * t2x - nx)
        fy = F * (alpha * t1y + beta * t2y - ny)
        fz = F * (alpha * t1z + beta * t2z - nz)
        q = F * chi
        _moment_columns(J, 0, px, py, pz, fx, fy, fz)
        J[0, 3] += q * nx
        J[0, 4] += q * ny
        J[0, 5] += q * nz
        _moment_columns(J, 1, px, py, pz, F * t1x, F * t1y, F * t1z)
        _moment_columns(J, 2, px, py, pz, F * t2x, F * t2y, F * t2z)
        for i in range(3):
            J[3, i] = 0.0
            J[4, i] = 0.0
            J[5, i] = 0.0
        J[3, 3], J[3, 4], J[3, 5] = F * nx, F * ny, F * nz
        J[4, 3], J[4, 4], J[4, 5] = t1y * fz - t1z * fy, t1z * fx - t1x * fz, t1x * fy - t1y * fx
        J[5, 3], J[5, 4], J[5, 5] = t2y * fz - t2z * fy, t2z * fx - t2x * fz, t2x * fy - t2y * fx
        rho = (alpha * alpha + beta * beta) * lean
        tail = (TAIL + 2.0) / (TAIL + rho)
        d = (J[0, 0] - w[0], J[0, 1] - w[1], J[0, 2] - w[2], J[0, 3] - w[3], J[0, 4] - w[4], J[0, 5] - w[5])
        dLd = 0.0
        for i in range(6):
            Ld = 0.0
            for k in range(6):
                Ld += L[i, k] * d[k]
            dLd += d[i] * Ld
            # Row i of L J^T is kept as A[:, i].
            for k in range(6):
                A[k, i] = (
                    L[i, 0] * J[k, 0]
                    + L[i, 1] * J[k, 1]
                    + L[i, 2] * J[k, 2]
                    + L[i, 3] * J[k, 3]
                    + L[i, 4] * J[k, 4]
                    + L[i, 5] * J[k, 5]
                )
        energy = 0.5 * (
            dLd
            + phi * phi
            + (TAIL + 2.0) * math.log(1.0 + rho / TAIL)
            + chi * chi * lever
            + (v1 * v1 + v2 * v2) * cell
        )
        for i in range(6):
            g[i] = (
                A[i, 0] * d[0]
                + A[i, 1] * d[1]
                + A[i, 2] * d[2]
                + A[i, 3] * d[3]
                + A[i, 4] * d[4]
                + A[i, 5] * d[5]
            )
            for k in range(i, 6):
                H[i, k] = (
                    A[i, 0] * J[k, 0]
                    + A[i, 1] * J[k, 1]
                    + A[i, 2] * J[k, 2]
                    + A[i, 3] * J[k, 3]
                    + A[i, 4] * J[k, 4]
                    + A[i, 5] * J[k, 5]
                )
        g[0] += phi
        g[1] += tail * alpha * lean
        g[2] += tail * beta * lean
        g[3] += chi * lever
        g[4] += v1 * cell
        g[5] += v2 * cell
        H[0, 0] += 1.0
        H[1, 1] += tail * lean
        H[2, 2] += tail * lean
        H[3, 3] += lever
        H[4, 4] += cell
        H[5, 5] += cell
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
    if log_det == math.inf or energy > limit:
        return math.inf, -math.inf, px, py, pz, 0.0, fx, fy, fz
    log_z = -energy - 0.5 * log_det - math.log(prior.lean**2 * prior.lever * spread**2)
    return energy, log_z, px, py, pz, 0.5 * (v11 + v22), fx, fy, fz
