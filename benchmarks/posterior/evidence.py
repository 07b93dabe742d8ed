"""Evidence of one surface patch: a linear Gaussian model, integrated over the normal force.

A contact with the normal force F at a patch with outward normal n, tangents t1, t2 and centre c has about
c the wrench

    w = F (-n, 0) + a1 (t1, 0) + a2 (t2, 0) + xi (0, n) + d1 (0, t1 x f) + d2 (0, t2 x f) + e (0, n x f)

The standard deviations are friction_ratio F for a1, a2, torsion_lever F for xi, the spread of the patch
for d1, d2 (the contact is anywhere on it) and the surface deviation for e. Given F, and with f in the
last three terms replaced by its measured value, w is linear in six Gaussian unknowns, which are
integrated in closed form: first d1, d2, e, which do not depend on F, then a1, a2, xi for each F. The
prior of F is uniform in log F between two bounds. The integral over log F is a sum, around the patch's
own estimate of F if the measurement determines it.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.robots.jit.kernel import fused_kernel

NODES = 48
"""Number of normal forces in the sum over the full range."""
NARROW_FORCE = 0.15
"""Relative standard deviation of the normal force below which the sum covers its neighbourhood only."""
EVIDENCE_CUTOFF = 30.0
"""Patches whose log evidence is below the best so far by more than this are dropped."""
_ROUNDS = 6

_Six = tuple[float, float, float, float, float, float]


class Prior(NamedTuple):
    """Prior of a contact."""

    low: float
    """Minimum normal force [N]."""
    high: float
    """Maximum normal force [N]."""
    friction_ratio: float
    """Standard deviation of tangential over normal force."""
    torsion_lever: float
    """Standard deviation of torsion over normal force [m]."""
    surface_deviation: float
    """Standard deviation of the real surface's offset along the normal [m]."""


@fused_kernel
def gram(
    L: np.ndarray,
    w: np.ndarray,
    c: np.ndarray,
    n: np.ndarray,
    f: np.ndarray,
    spread: float,
    offset: float,
    out: np.ndarray,
) -> _Six:
    """Scalar products of the eight columns d1, d2, e, a1, a2, xi, -F and the measurement.

    Args:
        L: Information matrix of the wrench about the frame's origin, shape (6, 6).
        w: Measured wrench about the frame's origin, shape (6,).
        c, n: Middle of the patch and outward normal, shape (3,).
        f: What is taken for the force in the moment of a displacement, shape (3,).
        spread, offset: Standard deviations of displacements along and across the patch [m].
        out: Filled, the eight columns' products in the metric of L, each unknown in units of its prior where
            that does not depend on F, shape (8, 8).

    Returns:
        The tangents, six floats.
    """
    nx, ny, nz = n[0], n[1], n[2]
    sign = 1.0 if nz >= 0.0 else -1.0
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    t1 = (1.0 + sign * nx * nx * a, sign * b, -sign * nx)
    t2 = (b, sign + ny * ny * a, -ny)
    fx, fy, fz = f[0], f[1], f[2]
    x, y, z = c[0], c[1], c[2]
    columns = (
        _moment(spread, t1[1] * fz - t1[2] * fy, t1[2] * fx - t1[0] * fz, t1[0] * fy - t1[1] * fx),
        _moment(spread, t2[1] * fz - t2[2] * fy, t2[2] * fx - t2[0] * fz, t2[0] * fy - t2[1] * fx),
        _moment(offset, ny * fz - nz * fy, nz * fx - nx * fz, nx * fy - ny * fx),
        _force(t1[0], t1[1], t1[2], x, y, z),
        _force(t2[0], t2[1], t2[2], x, y, z),
        _moment(1.0, nx, ny, nz),
        _force(nx, ny, nz, x, y, z),
        (w[0], w[1], w[2], w[3], w[4], w[5]),
    )
    for k in range(8):
        q = columns[k]
        v0, v1, v2 = _row(L, 0, q), _row(L, 1, q), _row(L, 2, q)
        v3, v4, v5 = _row(L, 3, q), _row(L, 4, q), _row(L, 5, q)
        for i in range(k + 1):
            p = columns[i]
            out[k, i] = v0 * p[0] + v1 * p[1] + v2 * p[2] + v3 * p[3] + v4 * p[4] + v5 * p[5]
            out[i, k] = out[k, i]
    return t1[0], t1[1], t1[2], t2[0], t2[1], t2[2]


@fused_kernel
def _row(L: np.ndarray, i: int, q: _Six) -> float:
    """Row i of the matrix times the vector."""
    total: float = (
        L[i, 0] * q[0] + L[i, 1] * q[1] + L[i, 2] * q[2] + L[i, 3] * q[3] + L[i, 4] * q[4] + L[i, 5] * q[5]
    )
    return total


@fused_kernel
def _moment(scale: float, x: float, y: float, z: float) -> _Six:
    return 0.0, 0.0, 0.0, scale * x, scale * y, scale * z


@fused_kernel
def _force(fx: float, fy: float, fz: float, x: float, y: float, z: float) -> _Six:
    """Wrench of a unit force at (x, y, z)."""
    return fx, fy, fz, y * fz - z * fy, z * fx - x * fz, x * fy - y * fx


@fused_kernel
def eliminate(M: np.ndarray) -> float:
    """Integrate the displacements, rows 0 to 2, out of `M` in place; returns half the log determinant."""
    half_log_det = 0.0
    for k in range(3):
        pivot = M[k, k] + 1.0
        half_log_det += 0.5 * math.log(pivot)
        for i in range(k + 1, 8):
            factor = M[i, k] / pivot
            for j in range(i, 8):
                M[j, i] -= factor * M[j, k]
                M[i, j] = M[j, i]
    return half_log_det


@fused_kernel
def at_force(
    M: np.ndarray, F: float, friction_ratio: float, torsion_lever: float
) -> tuple[float, float, float]:
    """Log evidence at one normal force, and the quadratic energy over F for the friction at that force.

    Args:
        M: From `eliminate`.
        F: Normal force [N].
        friction_ratio, torsion_lever: Standard deviations of tangential force and torsion over F.

    Returns:
        Log evidence up to a constant, and slope and curvature of the energy at F = 0.
    """
    d = 1.0 / (friction_ratio * F) ** 2
    h00 = M[3, 3] + d
    h11 = M[4, 4] + d
    h22 = M[5, 5] + 1.0 / (torsion_lever * F) ** 2
    l10 = M[4, 3] / h00
    l20 = M[5, 3] / h00
    h11 -= l10 * M[4, 3]
    e = M[5, 4] - l10 * M[5, 3]
    l21 = e / h11
    h22 -= l20 * M[5, 3] + l21 * e
    # Forward substitution of the columns -F (6) and measurement (7).
    n0, y0 = M[6, 3], M[7, 3]
    n1, y1 = M[6, 4] - l10 * n0, M[7, 4] - l10 * y0
    n2, y2 = M[6, 5] - l20 * n0 - l21 * n1, M[7, 5] - l20 * y0 - l21 * y1
    curvature = M[6, 6] - n0 * n0 / h00 - n1 * n1 / h11 - n2 * n2 / h22
    slope = M[7, 6] - n0 * y0 / h00 - n1 * y1 / h11 - n2 * y2 / h22
    squared_residual = M[7, 7] - y0 * y0 / h00 - y1 * y1 / h11 - y2 * y2 / h22
    energy = 0.5 * (squared_residual + F * (2.0 * slope + F * curvature))
    log_det = math.log(h00 * h11 * h22) - 2.0 * math.log(d) + 2.0 * math.log(torsion_lever * F)
    return -energy - 0.5 * log_det, slope, curvature


@fused_kernel
def over_force(M: np.ndarray, prior: Prior, initial_force: float, threshold: float) -> tuple[float, float]:
    """Log evidence of a patch, integrated over all normal forces, and its estimate of the normal force
    [N].

    Args:
        M: From `eliminate`.
        prior: Prior of contacts.
        initial_force: Initial normal force [N].
        threshold: Patches below this log evidence are skipped and get -inf.
    """
    friction_ratio, F = prior.friction_ratio, initial_force
    value, slope, curvature = at_force(M, F, friction_ratio, prior.torsion_lever)
    for _ in range(_ROUNDS):
        G = min(max(-slope / curvature, prior.low), prior.high) if curvature > 0.0 else prior.high
        converged = (G - F) ** 2 * curvature < 0.1
        F = G
        value, slope, curvature = at_force(M, F, friction_ratio, prior.torsion_lever)
        if converged:
            break
    if value < threshold:
        return -math.inf, initial_force
    log_range = math.log(prior.high / prior.low)
    deviation = 1.0 / (F * math.sqrt(curvature)) if curvature > 0.0 else math.inf
    inside = F * math.exp(4.0 * deviation) < prior.high and F * math.exp(-4.0 * deviation) > prior.low
    if deviation < NARROW_FORCE and inside:
        integral = _sum(M, prior, math.log(F) - 4.0 * deviation, deviation, 9)
    else:
        step = log_range / NODES
        integral = _sum(M, prior, math.log(prior.low) + 0.5 * step, step, NODES)
    return integral - math.log(log_range), F


@fused_kernel
def _sum(M: np.ndarray, prior: Prior, first: float, step: float, count: int) -> float:
    """Log of the integral over log F by equal steps."""
    total = -math.inf
    for i in range(count):
        total = _add(
            total, at_force(M, math.exp(first + i * step), prior.friction_ratio, prior.torsion_lever)[0]
        )
    return total + math.log(step)


@fused_kernel
def _add(a: float, b: float) -> float:
    """Log of the sum of two numbers given by their logarithms, the second finite."""
    if a == -math.inf:
        return b
    return max(a, b) + math.log1p(math.exp(-math.fabs(a - b)))
