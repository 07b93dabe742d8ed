"""Cholesky factors of symmetric positive definite matrices of any size, and systems of equations with them,
without allocation."""

import math

import numpy as np

from contactsense.robots.jit.kernel import fused_kernel


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
def substitute_lower(L: np.ndarray, size: int, B: np.ndarray, columns: int) -> None:
    """Solve L X = B in place of B, shape (>= `size`, >= `columns`), with a Cholesky factor L."""
    for r in range(size):
        for s in range(r):
            x = L[r, s]
            for c in range(columns):
                B[r, c] -= x * B[s, c]
        x = 1.0 / L[r, r]
        for c in range(columns):
            B[r, c] *= x


@fused_kernel
def cholesky_solve(L: np.ndarray, size: int, B: np.ndarray, columns: int) -> None:
    """Solve L L^T X = B in place of B; arguments as for `substitute_lower`."""
    substitute_lower(L, size, B, columns)
    for r in range(size - 1, -1, -1):
        for s in range(r + 1, size):
            x = L[s, r]
            for c in range(columns):
                B[r, c] -= x * B[s, c]
        x = 1.0 / L[r, r]
        for c in range(columns):
            B[r, c] *= x
