"""Transform a wrench and its information matrix to another point and another frame.

The matrix is split into 3x3 blocks, L = [F D^T; D M] with F of the force, M of the moment. Blocks are tuples
of rows, so that the compiler keeps them in registers; it must assume that arrays which one function reads and
writes overlap.
"""

import numpy as np

from contactsense.kinematics.spatial import Six
from contactsense.robots.jit.kernel import fused_kernel, inlined_fused_kernel
from contactsense.robots.vectors import Vector

Block = tuple[Vector, Vector, Vector]
"""A 3x3 block, as its rows."""


@fused_kernel
def to_body_frame(
    w: np.ndarray, L: np.ndarray, R: np.ndarray, o: np.ndarray, local_w: np.ndarray, local_L: np.ndarray
) -> None:
    """Transform a fused wrench and its information matrix to a body frame.

    Args:
        w, L: Wrench about the base origin and its information matrix, base axes, shapes (6,) and (6, 6).
        R, o: Axes (columns) and origin [m] of the body frame in the base frame, shapes (3, 3) and (3,).
        local_w, local_L: Filled: wrench about the origin of the body frame and its information, body axes.
    """
    x, y, z = o[0], o[1], o[2]
    mx, my, mz = w[3] - y * w[2] + z * w[1], w[4] - z * w[0] + x * w[2], w[5] - x * w[1] + y * w[0]
    # Body axes as rows.
    axes = (
        (R[0, 0], R[1, 0], R[2, 0]),
        (R[0, 1], R[1, 1], R[2, 1]),
        (R[0, 2], R[1, 2], R[2, 2]),
    )
    F, D, M = blocks(L)
    F, D, M = shift_information(F, D, M, x, y, z)
    force, across, moment = rotate_block(axes, F), rotate_block(axes, D), rotate_block(axes, M)
    for i in range(3):
        a = axes[i]
        local_w[i] = a[0] * w[0] + a[1] * w[1] + a[2] * w[2]
        local_w[i + 3] = a[0] * mx + a[1] * my + a[2] * mz
        for k in range(3):
            local_L[i, k] = force[i][k]
            local_L[i + 3, k] = across[i][k]
            local_L[k, i + 3] = across[i][k]
            local_L[i + 3, k + 3] = moment[i][k]


@inlined_fused_kernel
def blocks(L: np.ndarray) -> tuple[Block, Block, Block]:
    """The blocks F, D and M of an information matrix, each a tuple of rows."""
    return (
        ((L[0, 0], L[0, 1], L[0, 2]), (L[1, 0], L[1, 1], L[1, 2]), (L[2, 0], L[2, 1], L[2, 2])),
        ((L[3, 0], L[3, 1], L[3, 2]), (L[4, 0], L[4, 1], L[4, 2]), (L[5, 0], L[5, 1], L[5, 2])),
        ((L[3, 3], L[3, 4], L[3, 5]), (L[4, 3], L[4, 4], L[4, 5]), (L[5, 3], L[5, 4], L[5, 5])),
    )


@inlined_fused_kernel
def shift_information(
    F: Block, D: Block, M: Block, x: float, y: float, z: float
) -> tuple[Block, Block, Block]:
    """Information about another point c = (x, y, z): X^T L X with X = [1 0; [c]x 1].

    Returns:
        The blocks F, D and M of it.
    """
    # A row times [c]x is the row's cross product with c.
    half = (
        _add_cross(F[0], (D[0][0], D[1][0], D[2][0]), x, y, z),
        _add_cross(F[1], (D[0][1], D[1][1], D[2][1]), x, y, z),
        _add_cross(F[2], (D[0][2], D[1][2], D[2][2]), x, y, z),
    )
    D = (_add_cross(D[0], M[0], x, y, z), _add_cross(D[1], M[1], x, y, z), _add_cross(D[2], M[2], x, y, z))
    # The same for its columns; F is symmetric, so that its columns are its rows.
    F = (
        _add_cross((half[0][0], half[1][0], half[2][0]), (D[0][0], D[1][0], D[2][0]), x, y, z),
        _add_cross((half[0][1], half[1][1], half[2][1]), (D[0][1], D[1][1], D[2][1]), x, y, z),
        _add_cross((half[0][2], half[1][2], half[2][2]), (D[0][2], D[1][2], D[2][2]), x, y, z),
    )
    return F, D, M


@inlined_fused_kernel
def _add_cross(a: Vector, b: Vector, x: float, y: float, z: float) -> Vector:
    """a + b x (x, y, z)."""
    return a[0] + b[1] * z - b[2] * y, a[1] + b[2] * x - b[0] * z, a[2] + b[0] * y - b[1] * x


@inlined_fused_kernel
def rotate_block(axes: Block, B: Block) -> Block:
    """A block in the frame with these axes: a_i . B a_k."""
    p, q, r = matvec(B, axes[0]), matvec(B, axes[1]), matvec(B, axes[2])
    return (
        (dot(axes[0], p), dot(axes[0], q), dot(axes[0], r)),
        (dot(axes[1], p), dot(axes[1], q), dot(axes[1], r)),
        (dot(axes[2], p), dot(axes[2], q), dot(axes[2], r)),
    )


@inlined_fused_kernel
def dot(a: Vector, b: Vector) -> float:
    """a . b of three numbers each."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined_fused_kernel
def cross(a: Vector, b: Vector) -> Vector:
    """a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined_fused_kernel
def matvec(B: Block, a: Vector) -> Vector:
    """B a, with B a block, a tuple of rows."""
    return dot(B[0], a), dot(B[1], a), dot(B[2], a)


@inlined_fused_kernel
def symmetric_matvec(S: Six, a: Vector) -> Vector:
    """S a, with S a symmetric matrix, its upper triangle (xx, xy, xz, yy, yz, zz)."""
    return (
        S[0] * a[0] + S[1] * a[1] + S[2] * a[2],
        S[1] * a[0] + S[3] * a[1] + S[4] * a[2],
        S[2] * a[0] + S[4] * a[1] + S[5] * a[2],
    )


@inlined_fused_kernel
def shift_vector(f: Vector, m: Vector, x: float, y: float, z: float) -> Vector:
    """The force part of X^T h about another point, see `shift_information`, with h = (f, m)."""
    return f[0] + m[1] * z - m[2] * y, f[1] + m[2] * x - m[0] * z, f[2] + m[0] * y - m[1] * x


@inlined_fused_kernel
def transposed_matvec(B: Block, a: Vector) -> Vector:
    """B^T a."""
    return (
        B[0][0] * a[0] + B[1][0] * a[1] + B[2][0] * a[2],
        B[0][1] * a[0] + B[1][1] * a[1] + B[2][1] * a[2],
        B[0][2] * a[0] + B[1][2] * a[1] + B[2][2] * a[2],
    )


@inlined_fused_kernel
def transposed_product(A: Block, B: Block) -> Block:
    """A^T B."""
    return (
        transposed_matvec(B, (A[0][0], A[1][0], A[2][0])),
        transposed_matvec(B, (A[0][1], A[1][1], A[2][1])),
        transposed_matvec(B, (A[0][2], A[1][2], A[2][2])),
    )


@inlined_fused_kernel
def difference(A: Block, B: Block) -> Block:
    """A - B."""
    return (
        (A[0][0] - B[0][0], A[0][1] - B[0][1], A[0][2] - B[0][2]),
        (A[1][0] - B[1][0], A[1][1] - B[1][1], A[1][2] - B[1][2]),
        (A[2][0] - B[2][0], A[2][1] - B[2][1], A[2][2] - B[2][2]),
    )


@inlined_fused_kernel
def scaled(A: Block, s: float) -> Block:
    """s A."""
    return (
        (s * A[0][0], s * A[0][1], s * A[0][2]),
        (s * A[1][0], s * A[1][1], s * A[1][2]),
        (s * A[2][0], s * A[2][1], s * A[2][2]),
    )
