"""Symmetric positive definite linear equations of any size, by the Cholesky factor of the lower triangle,
without allocation."""

import math
from typing import Protocol

import numpy as np

from contactsense.robots.jit.kernel import fused_kernel


class Factored(Protocol):
    """A tuple with a factored matrix and room for its inverse, both square and of the same shape."""

    @property
    def matrix(self) -> np.ndarray:
        """The Cholesky factor, in the lower triangle."""

    @property
    def inverse(self) -> np.ndarray:
        """Filled with the inverse."""


@fused_kernel
def cholesky(A: np.ndarray, size: int) -> float:
    """Cholesky factor in place of the lower triangle; returns the log determinant, infinite if A is not
    positive definite."""
    det = 1.0
    log_det = 0.0
    for j in range(size):
        d = A[j, j]
        for k in range(j):
            d -= A[j, k] * A[j, k]
        if not d > 0.0:
            return math.inf
        det *= d
        if not 1e-200 < det < 1e200:
            log_det += math.log(det)
            det = 1.0
        d = math.sqrt(d)
        A[j, j] = d
        d = 1.0 / d
        for i in range(j + 1, size):
            x = A[i, j]
            for k in range(j):
                x -= A[i, k] * A[j, k]
            A[i, j] = x * d
    return log_det + math.log(det)


@fused_kernel
def solve_in_place(H: np.ndarray, g: np.ndarray, size: int) -> tuple[float, float]:
    """Solve H x = g in place of g and factor H in place; log determinant of H, and 1/2 g . x."""
    log_det = cholesky(H, size)
    if log_det == math.inf:
        return math.inf, 0.0
    predicted_decrease = 0.0
    for i in range(size):
        x = g[i]
        for k in range(i):
            x -= H[i, k] * g[k]
        g[i] = x / H[i, i]
        predicted_decrease += 0.5 * g[i] * g[i]
    for i in range(size - 1, -1, -1):
        x = g[i]
        for k in range(i + 1, size):
            x -= H[k, i] * g[k]
        g[i] = x / H[i, i]
    if not predicted_decrease < math.inf:
        return math.inf, 0.0
    return log_det, predicted_decrease


@fused_kernel
def invert_factored(stack: Factored, size: int) -> None:
    """Fill `stack.inverse` with the inverse from the Cholesky factor in `stack.matrix`."""
    L, V = stack.matrix, stack.inverse
    for column in range(size):
        for i in range(column, size):
            x = 1.0 if i == column else 0.0
            for k in range(column, i):
                x -= L[i, k] * V[k, column]
            V[i, column] = x / L[i, i]
    # The lower triangle of V is the inverse of the factor; that of the matrix is V^T V, row by row.
    for i in range(size):
        for j in range(i + 1):
            x = 0.0
            for k in range(i, size):
                x += V[k, i] * V[k, j]
            V[j, i] = x
    for i in range(size):
        for j in range(i):
            V[i, j] = V[j, i]
