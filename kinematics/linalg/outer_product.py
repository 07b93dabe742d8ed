"""Rank-one updates of symmetric 6x6 matrices."""

import numpy as np

from contactsense.kinematics.spatial import Six
from contactsense.robots.jit.kernel import fused_kernel


@fused_kernel
def add_outer_product(H: np.ndarray, weight: float, row: np.ndarray | Six) -> None:
    """Add weight x x^T to the upper triangle of H, with x the six numbers of `row`; unrolled, as loops are
    slower."""
    x0, x1, x2, x3, x4, x5 = row
    y0, y1, y2, y3, y4, y5 = weight * x0, weight * x1, weight * x2, weight * x3, weight * x4, weight * x5
    H[0, 0] += y0 * x0
    H[0, 1] += y0 * x1
    H[0, 2] += y0 * x2
    H[0, 3] += y0 * x3
    H[0, 4] += y0 * x4
    H[0, 5] += y0 * x5
    H[1, 1] += y1 * x1
    H[1, 2] += y1 * x2
    H[1, 3] += y1 * x3
    H[1, 4] += y1 * x4
    H[1, 5] += y1 * x5
    H[2, 2] += y2 * x2
    H[2, 3] += y2 * x3
    H[2, 4] += y2 * x4
    H[2, 5] += y2 * x5
    H[3, 3] += y3 * x3
    H[3, 4] += y3 * x4
    H[3, 5] += y3 * x5
    H[4, 4] += y4 * x4
    H[4, 5] += y4 * x5
    H[5, 5] += y5 * x5


@fused_kernel
def add_scaled_vector(g: np.ndarray, value: float, row: np.ndarray | Six) -> None:
    """Add `value` times the six numbers of `row` to g."""
    x0, x1, x2, x3, x4, x5 = row
    g[0] += value * x0
    g[1] += value * x1
    g[2] += value * x2
    g[3] += value * x3
    g[4] += value * x4
    g[5] += value * x5


@fused_kernel
def symmetrize(H: np.ndarray) -> None:
    """Copy the upper triangle of H to the lower one."""
    for i in range(6):
        for k in range(i):
            H[i, k] = H[k, i]
