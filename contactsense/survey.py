"""How well contacts at fixed places explain a measurement: the search where the measurement says little.

Where the place is open by more than a few centimetres, no line tells where to look and one optimum does not
stand for the answer. Every place of `contactsense.places` is tried instead, and the sum over them is the
integral over the surface. The unknowns at a place are the logarithm phi of the normal force F, the force's
lean (alpha, beta) and the lever chi of the torsion, both in units of the normal force, and a shift (v1, v2)
within the cell:

    f = F (-n + alpha t1 + beta t2),    m = c x f + F chi n,    c = c0 + v1 t1 + v2 t2

In these all priors are normal distributions (that of the lean Student's), so that a measurement which says
nothing leaves just them. Laplace's integral over the six gives the evidence of the cell. All is done in the
axes (n, t1, t2) with the origin c0, where the wrench and its derivatives are mostly zeros:

    f = F (-1, alpha, beta),    m = F (chi + beta v1 - alpha v2, -v2, v1)

A block of cells goes through the search side by side, one in each lane (see `contactsense.lanes`).
"""

import math

from contactsense.energy import TAIL, tangents

from contactsense.lanes import (  # isort: skip
    A00, A01, A02, A03, A04, A05, A11, A12, A13, A14, A15, A22, A23, A24, A25, A33, A34, A35, A44, A45, A55,
    ALPHA, BETA, CHI, DET, ENERGY, FORCE, GOING, LANES, LEAN, NX, NY, NZ, SIZE, SPREAD, T1X, T1Y, T1Z, T2X,
    T2Y, T2Z, V1, V2, VARIANCE, W0, W1, W2, W3, W4, W5, X, Y, Z,
)  # fmt: skip
from contactsense.ldl import eliminate
from contactsense.view import about, blocks, times, turned
from robots.compiled import fused_kernel

STEPS = 6
"""Most Gauss-Newton steps at one place."""
ENOUGH = 0.1
"""A step that promises less gain than this is the last at a place."""
STEEPEST = 0.3
"""Least normal force that a search starts with, as a part of the measured force."""
WEAKEST = 1e-3
"""The same, in units of the usual normal force."""
LONGEST = 1.5
"""Longest step in the logarithm of the force."""


@fused_kernel
def weigh(count, w, L, prior, known, limit, lanes):  # type: ignore[no-untyped-def]
    """Find the most probable contact in each cell of a block.

    Args:
        count: Cells in the block, at most `LANES`, all of one link.
        w, L: Fused wrench and its information matrix, link frame, shapes (6,) and (6, 6).
        prior: What is known of contacts beforehand.
        known: Whether the force was measured: the search starts with it.
        limit: Energy above which a place is of no interest.
        lanes: The block, with the cells' places, normals and spreads; filled with what `evidence` reads.
    """
    _see(w, L, lanes)
    _start(prior, known, lanes)
    lean, lever = 1.0 / prior.lean**2, 1.0 / prior.lever**2
    for j in range(LANES):
        lanes[GOING + j] = 1.0 if j < count else 0.0
        lanes[SIZE + j] = math.log(lanes[FORCE + j] / prior.force)
    for step in range(STEPS + 1):
        _step(lean, lever, limit, step < STEPS, lanes)
        going = 0
        for j in range(count):
            if lanes[GOING + j] > 0.0:
                lanes[FORCE + j] = prior.force * math.exp(lanes[SIZE + j])
                going += 1
        if going == 0:
            break


@fused_kernel
def evidence(j, prior, limit, lanes):  # type: ignore[no-untyped-def]
    """What `weigh` has found in one cell.

    Args:
        j: Number of the cell in the block.
        prior, limit, lanes: As for `weigh`.

    Returns:
        Energy; log of the mean evidence over the cell (up to the noise's own constant; -infinity beyond the
        limit), the most probable place in the cell (3) [m], and force (3) [N], link frame.
    """
    alpha, beta, v1, v2 = lanes[ALPHA + j], lanes[BETA + j], lanes[V1 + j], lanes[V2 + j]
    F = prior.force * math.exp(lanes[SIZE + j])
    t1x, t1y, t1z = lanes[T1X + j], lanes[T1Y + j], lanes[T1Z + j]
    t2x, t2y, t2z = lanes[T2X + j], lanes[T2Y + j], lanes[T2Z + j]
    x, y, z = (
        lanes[X + j] + v1 * t1x + v2 * t2x,
        lanes[Y + j] + v1 * t1y + v2 * t2y,
        lanes[Z + j] + v1 * t1z + v2 * t2z,
    )
    fx, fy, fz = (
        F * (alpha * t1x + beta * t2x - lanes[NX + j]),
        F * (alpha * t1y + beta * t2y - lanes[NY + j]),
        F * (alpha * t1z + beta * t2z - lanes[NZ + j]),
    )
    energy = lanes[ENERGY + j] + 0.5 * (TAIL + 2.0) * math.log(1.0 + lanes[LEAN + j] / TAIL)
    if not (lanes[DET + j] > 0.0 and energy <= limit):
        return math.inf, -math.inf, x, y, z, fx, fy, fz
    scale = prior.lean**2 * prior.lever * lanes[SPREAD + j] ** 2
    log_z = -energy - 0.5 * math.log(lanes[DET + j]) - math.log(scale)
    return energy, log_z, x, y, z, fx, fy, fz


@fused_kernel
def _see(w, L, lanes):  # type: ignore[no-untyped-def]
    """Wrench and information about each cell's place, in the axes of its normal and tangents: what
    `contactsense.view.view` does for one."""
    f, m = (w[0], w[1], w[2]), (w[3], w[4], w[5])
    force, across, moment = blocks(L)
    for j in range(LANES):
        x, y, z = lanes[X + j], lanes[Y + j], lanes[Z + j]
        n = (lanes[NX + j], lanes[NY + j], lanes[NZ + j])
        t1x, t1y, t1z, t2x, t2y, t2z = tangents(n[0], n[1], n[2])
        lanes[T1X + j], lanes[T1Y + j], lanes[T1Z + j] = t1x, t1y, t1z
        lanes[T2X + j], lanes[T2Y + j], lanes[T2Z + j] = t2x, t2y, t2z
        axes = (n, (t1x, t1y, t1z), (t2x, t2y, t2z))
        moved = (m[0] - y * f[2] + z * f[1], m[1] - z * f[0] + x * f[2], m[2] - x * f[1] + y * f[0])
        lanes[W0 + j], lanes[W1 + j], lanes[W2 + j] = times(axes, f)
        lanes[W3 + j], lanes[W4 + j], lanes[W5 + j] = times(axes, moved)
        F, D, M = about(force, across, moment, x, y, z)
        F, D, M = turned(axes, F), turned(axes, D), turned(axes, M)
        lanes[A00 + j], lanes[A01 + j], lanes[A02 + j] = F[0]
        lanes[A11 + j], lanes[A12 + j], lanes[A22 + j] = F[1][1], F[1][2], F[2][2]
        lanes[A03 + j], lanes[A13 + j], lanes[A23 + j] = D[0]
        lanes[A04 + j], lanes[A14 + j], lanes[A24 + j] = D[1]
        lanes[A05 + j], lanes[A15 + j], lanes[A25 + j] = D[2]
        lanes[A33 + j], lanes[A34 + j], lanes[A35 + j] = M[0]
        lanes[A44 + j], lanes[A45 + j], lanes[A55 + j] = M[1][1], M[1][2], M[2][2]


@fused_kernel
def _start(prior, known, lanes):  # type: ignore[no-untyped-def]
    """The search starts at the measured force, if there is one, else at a usual one."""
    for j in range(LANES):
        w0, w1, w2 = lanes[W0 + j], lanes[W1 + j], lanes[W2 + j]
        least = max(STEEPEST * math.sqrt(w0 * w0 + w1 * w1 + w2 * w2), WEAKEST * prior.force)
        F = max(-w0, least) if known else prior.force
        lanes[FORCE + j] = F
        lanes[ALPHA + j] = w1 / F if known else 0.0
        lanes[BETA + j] = w2 / F if known else 0.0
        lanes[CHI + j], lanes[V1 + j], lanes[V2 + j] = 0.0, 0.0, 0.0


@fused_kernel
def _step(lean, lever, limit, more, lanes):  # type: ignore[no-untyped-def]
    """Energy, its curvature, and a Gauss-Newton step for all cells that are still going and gain by it.

    Args:
        lean, lever: Inverse variances of the lean and of the torsion's lever.
        limit: Energy above which a place is of no interest.
        more: Whether any steps may be made.
        lanes: The block.
    """
    for j in range(LANES):
        w0, w1, w2 = lanes[W0 + j], lanes[W1 + j], lanes[W2 + j]
        w3, w4, w5 = lanes[W3 + j], lanes[W4 + j], lanes[W5 + j]
        a00, a01, a02 = lanes[A00 + j], lanes[A01 + j], lanes[A02 + j]
        a03, a04, a05 = lanes[A03 + j], lanes[A04 + j], lanes[A05 + j]
        a11, a12, a13 = lanes[A11 + j], lanes[A12 + j], lanes[A13 + j]
        a14, a15, a22 = lanes[A14 + j], lanes[A15 + j], lanes[A22 + j]
        a23, a24, a25 = lanes[A23 + j], lanes[A24 + j], lanes[A25 + j]
        a33, a34, a35 = lanes[A33 + j], lanes[A34 + j], lanes[A35 + j]
        a44, a45, a55 = lanes[A44 + j], lanes[A45 + j], lanes[A55 + j]
        phi, F, alpha, beta = lanes[SIZE + j], lanes[FORCE + j], lanes[ALPHA + j], lanes[BETA + j]
        chi, v1, v2 = lanes[CHI + j], lanes[V1 + j], lanes[V2 + j]
        cell = 1.0 / (lanes[SPREAD + j] * lanes[SPREAD + j])
        # The contact's wrench, and by how much it misses the measured one.
        f0, f1, f2 = -F, F * alpha, F * beta
        m0, m1, m2 = F * (chi + beta * v1 - alpha * v2), -F * v2, F * v1
        d0, d1, d2, d3, d4, d5 = f0 - w0, f1 - w1, f2 - w2, m0 - w3, m1 - w4, m2 - w5
        # A times these.
        y0 = a00 * d0 + a01 * d1 + a02 * d2 + a03 * d3 + a04 * d4 + a05 * d5
        y1 = a01 * d0 + a11 * d1 + a12 * d2 + a13 * d3 + a14 * d4 + a15 * d5
        y2 = a02 * d0 + a12 * d1 + a22 * d2 + a23 * d3 + a24 * d4 + a25 * d5
        y3 = a03 * d0 + a13 * d1 + a23 * d2 + a33 * d3 + a34 * d4 + a35 * d5
        y4 = a04 * d0 + a14 * d1 + a24 * d2 + a34 * d3 + a44 * d4 + a45 * d5
        y5 = a05 * d0 + a15 * d1 + a25 * d2 + a35 * d3 + a45 * d4 + a55 * d5
        z0 = a00 * f0 + a01 * f1 + a02 * f2 + a03 * m0 + a04 * m1 + a05 * m2
        z1 = a01 * f0 + a11 * f1 + a12 * f2 + a13 * m0 + a14 * m1 + a15 * m2
        z2 = a02 * f0 + a12 * f1 + a22 * f2 + a23 * m0 + a24 * m1 + a25 * m2
        z3 = a03 * f0 + a13 * f1 + a23 * f2 + a33 * m0 + a34 * m1 + a35 * m2
        z4 = a04 * f0 + a14 * f1 + a24 * f2 + a34 * m0 + a44 * m1 + a45 * m2
        z5 = a05 * f0 + a15 * f1 + a25 * f2 + a35 * m0 + a45 * m1 + a55 * m2
        rho = (alpha * alpha + beta * beta) * lean
        tail = (TAIL + 2.0) / (TAIL + rho) * lean
        # All but the lean's own part, which takes a logarithm.
        energy = 0.5 * (
            (d0 * y0 + d1 * y1 + d2 * y2 + d3 * y3 + d4 * y4 + d5 * y5)
            + phi * phi
            + chi * chi * lever
            + (v1 * v1 + v2 * v2) * cell
        )
        # Derivatives of the wrench over F, rows (f0, f1, f2, m0, m1, m2): by alpha (0, 1, 0, -v2, 0, 0), by
        # beta (0, 0, 1, v1, 0, 0), by chi (0, 0, 0, 1, 0, 0), by v1 (0, 0, 0, beta, 0, 1), by v2 (0, 0, 0,
        # -alpha, -1, 0).
        FF = F * F
        b3, b4, b5 = a13 - v2 * a33, a14 - v2 * a34, a15 - v2 * a35
        c3, c4, c5 = a23 + v1 * a33, a24 + v1 * a34, a25 + v1 * a35
        p3, p4, p5 = beta * a33 + a35, beta * a34 + a45, beta * a35 + a55
        q3, q4 = -alpha * a33 - a34, -alpha * a34 - a44
        det, positive, hope, v11, _, v22, s0, s1, s2, s3, s4, s5 = eliminate(
            f0 * z0 + f1 * z1 + f2 * z2 + m0 * z3 + m1 * z4 + m2 * z5 + 1.0,
            F * (z1 - v2 * z3),
            F * (z2 + v1 * z3),
            F * z3,
            F * (beta * z3 + z5),
            -F * (alpha * z3 + z4),
            FF * (a11 - v2 * (a13 + b3)) + tail,
            FF * (a12 - v2 * a23 + v1 * b3),
            FF * b3,
            FF * (beta * b3 + b5),
            -FF * (alpha * b3 + b4),
            FF * (a22 + v1 * (a23 + c3)) + tail,
            FF * c3,
            FF * (beta * c3 + c5),
            -FF * (alpha * c3 + c4),
            FF * a33 + lever,
            FF * p3,
            FF * q3,
            FF * (beta * p3 + p5) + cell,
            -FF * (alpha * p3 + p4),
            -FF * (alpha * q3 + q4) + cell,
            f0 * y0 + f1 * y1 + f2 * y2 + m0 * y3 + m1 * y4 + m2 * y5 + phi,
            F * (y1 - v2 * y3) + tail * alpha,
            F * (y2 + v1 * y3) + tail * beta,
            F * y3 + chi * lever,
            F * (beta * y3 + y5) + v1 * cell,
            -F * (alpha * y3 + y4) + v2 * cell,
        )
        going = lanes[GOING + j] > 0.0
        # The last step is taken at its word: it leads to a place and an energy that are not looked at again.
        lanes[ENERGY + j] = energy - min(hope, ENOUGH) if going else lanes[ENERGY + j]
        lanes[LEAN + j] = rho if going else lanes[LEAN + j]
        lanes[VARIANCE + j] = 0.5 * (v11 + v22) if going else lanes[VARIANCE + j]
        lanes[DET + j] = (det if positive else 0.0) if going else lanes[DET + j]
        # The equations are bilinear in the force and the rest: a long step in the force is shortened.
        scale = min(1.0, LONGEST / max(abs(s0), 1e-300)) if going else 0.0
        again = going & positive & (hope >= ENOUGH) & (energy - 2.0 * hope <= limit) & more
        lanes[GOING + j] = 1.0 if again else 0.0
        lanes[SIZE + j] = phi - scale * s0
        lanes[ALPHA + j] = alpha - scale * s1
        lanes[BETA + j] = beta - scale * s2
        lanes[CHI + j] = chi - scale * s3
        lanes[V1 + j] = v1 - scale * s4
        lanes[V2 + j] = v2 - scale * s5
