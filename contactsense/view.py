"""A wrench and its information matrix seen from another frame."""

from robots.compiled import fused_kernel


@fused_kernel
def view(w, L, R, o, local_w, local_L, work):  # type: ignore[no-untyped-def]
    """Bring a fused wrench and its information matrix into a body frame.

    Args:
        w, L: Wrench about the base origin and its information matrix, base axes, shapes (6,) and (6, 6).
        R, o: Axes (columns) and origin [m] of the body frame in the base frame, shapes (3, 3) and (3,).
        local_w, local_L: Filled: wrench about the origin of the body frame and its information, body axes.
        work: Its `local` is used.
    """
    A, out = work.local, local_L
    x, y, z = o[0], o[1], o[2]
    mx, my, mz = w[3] - y * w[2] + z * w[1], w[4] - z * w[0] + x * w[2], w[5] - x * w[1] + y * w[0]
    for i in range(3):
        local_w[i] = R[0, i] * w[0] + R[1, i] * w[1] + R[2, i] * w[2]
        local_w[i + 3] = R[0, i] * mx + R[1, i] * my + R[2, i] * mz
    about(L, x, y, z, A)
    # Blocks of the upper triangle, turned: out = R^T A R.
    for block in range(3):
        r, c = (0, 0) if block == 0 else ((0, 3) if block == 1 else (3, 3))
        for i in range(3):
            h0 = R[0, i] * A[r, c] + R[1, i] * A[r + 1, c] + R[2, i] * A[r + 2, c]
            h1 = R[0, i] * A[r, c + 1] + R[1, i] * A[r + 1, c + 1] + R[2, i] * A[r + 2, c + 1]
            h2 = R[0, i] * A[r, c + 2] + R[1, i] * A[r + 1, c + 2] + R[2, i] * A[r + 2, c + 2]
            for k in range(3):
                out[r + i, c + k] = h0 * R[0, k] + h1 * R[1, k] + h2 * R[2, k]
    for i in range(3):
        for k in range(3):
            out[i + 3, k] = out[k, i + 3]


@fused_kernel
def about(L, x, y, z, A):  # type: ignore[no-untyped-def]
    """Information about another point: A = X^T L X with X = [1 0; [c]x 1], c = (x, y, z); first L X, then X^T
    that."""
    for i in range(6):
        a, b, c = L[i, 3], L[i, 4], L[i, 5]
        A[i, 0] = L[i, 0] + b * z - c * y
        A[i, 1] = L[i, 1] + c * x - a * z
        A[i, 2] = L[i, 2] + a * y - b * x
        A[i, 3] = a
        A[i, 4] = b
        A[i, 5] = c
    for k in range(6):
        a, b, c = A[3, k], A[4, k], A[5, k]
        A[0, k] += b * z - c * y
        A[1, k] += c * x - a * z
        A[2, k] += a * y - b * x
