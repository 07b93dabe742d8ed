"""Six linear equations by L D L^T, for the Newton step of `contactsense.solvers.posterior.mode`;
and the inverse of a covariance."""

import math

import numpy as np

from contactsense.kinematics.spatial import Six
from contactsense.robots.jit.kernel import fused_kernel, inlined_fused_kernel, kernel
from contactsense.robots.vectors import Vector

UpperTriangle = tuple[
    float, float, float, float, float, float, float, float, float, float, float,
    float, float, float, float, float, float, float, float, float, float,
]  # fmt: skip
"""Upper triangle of a symmetric 6x6 matrix, row by row."""
SMALLEST_DETERMINANT, LARGEST_DETERMINANT = 1e-300, 1e300
"""Matrices with determinants outside this range count as not positive definite."""


@inlined_fused_kernel
def ldl_solve_unrolled(H: UpperTriangle, g: Six) -> tuple[float, bool, float, Vector, Six]:
    """Solve H x = g by L D L^T. Unrolled, as loops are slower, and without branches, so that loops over many
    such equations are vectorized.

    Returns:
        Determinant of H; whether H is positive definite, otherwise the other results are invalid; 1/2 g . x;
        of H^-1 the entries 44, 45 and 55; and x.
    """
    (
        h00, h01, h02, h03, h04, h05, h11, h12, h13, h14, h15, h22, h23, h24, h25, h33, h34, h35,
        h44, h45, h55,
    ) = H  # fmt: skip
    g0, g1, g2, g3, g4, g5 = g
    d0 = h00
    i0 = 1.0 / d0
    u10 = h01
    l10 = u10 * i0
    d1 = h11 - u10 * l10
    i1 = 1.0 / d1
    u20 = h02
    l20 = u20 * i0
    u21 = h12 - u20 * l10
    l21 = u21 * i1
    d2 = h22 - u20 * l20 - u21 * l21
    i2 = 1.0 / d2
    u30 = h03
    l30 = u30 * i0
    u31 = h13 - u30 * l10
    l31 = u31 * i1
    u32 = h23 - u30 * l20 - u31 * l21
    l32 = u32 * i2
    d3 = h33 - u30 * l30 - u31 * l31 - u32 * l32
    i3 = 1.0 / d3
    u40 = h04
    l40 = u40 * i0
    u41 = h14 - u40 * l10
    l41 = u41 * i1
    u42 = h24 - u40 * l20 - u41 * l21
    l42 = u42 * i2
    u43 = h34 - u40 * l30 - u41 * l31 - u42 * l32
    l43 = u43 * i3
    d4 = h44 - u40 * l40 - u41 * l41 - u42 * l42 - u43 * l43
    i4 = 1.0 / d4
    u50 = h05
    l50 = u50 * i0
    u51 = h15 - u50 * l10
    l51 = u51 * i1
    u52 = h25 - u50 * l20 - u51 * l21
    l52 = u52 * i2
    u53 = h35 - u50 * l30 - u51 * l31 - u52 * l32
    l53 = u53 * i3
    u54 = h45 - u50 * l40 - u51 * l41 - u52 * l42 - u53 * l43
    l54 = u54 * i4
    d5 = h55 - u50 * l50 - u51 * l51 - u52 * l52 - u53 * l53 - u54 * l54
    i5 = 1.0 / d5
    y0 = g0
    y1 = g1 - l10 * y0
    y2 = g2 - l20 * y0 - l21 * y1
    y3 = g3 - l30 * y0 - l31 * y1 - l32 * y2
    y4 = g4 - l40 * y0 - l41 * y1 - l42 * y2 - l43 * y3
    y5 = g5 - l50 * y0 - l51 * y1 - l52 * y2 - l53 * y3 - l54 * y4
    z0 = y0 * i0
    z1 = y1 * i1
    z2 = y2 * i2
    z3 = y3 * i3
    z4 = y4 * i4
    z5 = y5 * i5
    predicted_decrease = 0.5 * (y0 * z0 + y1 * z1 + y2 * z2 + y3 * z3 + y4 * z4 + y5 * z5)
    x5 = z5
    x4 = z4 - l54 * x5
    x3 = z3 - l43 * x4 - l53 * x5
    x2 = z2 - l32 * x3 - l42 * x4 - l52 * x5
    x1 = z1 - l21 * x2 - l31 * x3 - l41 * x4 - l51 * x5
    x0 = z0 - l10 * x1 - l20 * x2 - l30 * x3 - l40 * x4 - l50 * x5
    det = d0 * d1 * d2 * d3 * d4 * d5
    # `&` compiles without a branch, unlike `and`.
    positive = (d0 > 0.0) & (d1 > 0.0) & (d2 > 0.0) & (d3 > 0.0) & (d4 > 0.0) & (d5 > 0.0)
    positive &= (det > SMALLEST_DETERMINANT) & (det < LARGEST_DETERMINANT)
    covariance = (i4 + l54 * l54 * i5, -l54 * i5, i5)
    return det, positive, predicted_decrease, covariance, (x0, x1, x2, x3, x4, x5)


@fused_kernel
def ldl_solve(H: np.ndarray, g: np.ndarray) -> tuple[float, float, float, float, float]:
    """Solve H x = g in place of g, from the upper triangle of H.

    Returns:
        Log determinant of H (infinity if H is not positive definite), 1/2 g . x, and of H^-1 the entries 44,
        45 and 55.
    """
    matrix = (
        H[0, 0], H[0, 1], H[0, 2], H[0, 3], H[0, 4], H[0, 5],
        H[1, 1], H[1, 2], H[1, 3], H[1, 4], H[1, 5],
        H[2, 2], H[2, 3], H[2, 4], H[2, 5],
        H[3, 3], H[3, 4], H[3, 5],
        H[4, 4], H[4, 5],
        H[5, 5],
    )  # fmt: skip
    vector = (g[0], g[1], g[2], g[3], g[4], g[5])
    det, positive, predicted_decrease, (v44, v45, v55), x = ldl_solve_unrolled(matrix, vector)
    if not positive:
        return math.inf, 0.0, 0.0, 0.0, 0.0
    g[0], g[1], g[2], g[3], g[4], g[5] = x
    return math.log(det), predicted_decrease, v44, v45, v55


@kernel
def half_squared_norm(C: np.ndarray, w: np.ndarray) -> float:
    """1/2 w . C^-1 w for a positive definite C, shape (6, 6). For others: any number, infinity or NaN."""
    c00, c10, c20, c30, c40, c50 = C[0, 0], C[1, 0], C[2, 0], C[3, 0], C[4, 0], C[5, 0]
    c11, c21, c31, c41, c51 = C[1, 1], C[2, 1], C[3, 1], C[4, 1], C[5, 1]
    c22, c32, c42, c52 = C[2, 2], C[3, 2], C[4, 2], C[5, 2]
    c33, c43, c53, c44, c54, c55 = C[3, 3], C[4, 3], C[5, 3], C[4, 4], C[5, 4], C[5, 5]
    w0, w1, w2, w3, w4, w5 = w[0], w[1], w[2], w[3], w[4], w[5]
    # One row and column is eliminated after the other, from C and from w.
    i = 1.0 / c00
    total = w0 * w0 * i
    a, b, c, d, e = c10 * i, c20 * i, c30 * i, c40 * i, c50 * i
    c11, c21, c31, c41, c51 = c11 - a * c10, c21 - a * c20, c31 - a * c30, c41 - a * c40, c51 - a * c50
    c22, c32, c42, c52 = c22 - b * c20, c32 - b * c30, c42 - b * c40, c52 - b * c50
    c33, c43, c53 = c33 - c * c30, c43 - c * c40, c53 - c * c50
    c44, c54, c55 = c44 - d * c40, c54 - d * c50, c55 - e * c50
    w1, w2, w3, w4, w5 = w1 - a * w0, w2 - b * w0, w3 - c * w0, w4 - d * w0, w5 - e * w0
    i = 1.0 / c11
    total += w1 * w1 * i
    b, c, d, e = c21 * i, c31 * i, c41 * i, c51 * i
    c22, c32, c42, c52 = c22 - b * c21, c32 - b * c31, c42 - b * c41, c52 - b * c51
    c33, c43, c53 = c33 - c * c31, c43 - c * c41, c53 - c * c51
    c44, c54, c55 = c44 - d * c41, c54 - d * c51, c55 - e * c51
    w2, w3, w4, w5 = w2 - b * w1, w3 - c * w1, w4 - d * w1, w5 - e * w1
    i = 1.0 / c22
    total += w2 * w2 * i
    c, d, e = c32 * i, c42 * i, c52 * i
    c33, c43, c53 = c33 - c * c32, c43 - c * c42, c53 - c * c52
    c44, c54, c55 = c44 - d * c42, c54 - d * c52, c55 - e * c52
    w3, w4, w5 = w3 - c * w2, w4 - d * w2, w5 - e * w2
    i = 1.0 / c33
    total += w3 * w3 * i
    d, e = c43 * i, c53 * i
    c44, c54, c55 = c44 - d * c43, c54 - d * c53, c55 - e * c53
    w4, w5 = w4 - d * w3, w5 - e * w3
    i = 1.0 / c44
    total += w4 * w4 * i
    e = c54 * i
    w5 = w5 - e * w4
    total += w5 * w5 / (c55 - e * c54)
    return float(0.5 * total)


@fused_kernel
def invert_spd(C: np.ndarray, out: np.ndarray) -> None:
    """Fill `out` with the inverse of a positive definite matrix, shape (6, 6), by Gauss-Jordan elimination
    without pivoting."""
    for i in range(6):
        for k in range(6):
            out[i, k] = C[i, k]
    for p in range(6):
        pivot = 1.0 / out[p, p]
        out[p, p] = 1.0
        for k in range(6):
            out[p, k] *= pivot
        for i in range(6):
            if i != p:
                factor = out[i, p]
                out[i, p] = 0.0
                for k in range(6):
                    out[i, k] -= factor * out[p, k]
