"""Three equations at a time: the force of a contact near a sample, and the moment that allows for the
distance between samples. Tuples of numbers without branches, so that loops over SIMD lanes are vectorized."""

from contactsense.kinematics.wrench_information import (
    Block,
    difference,
    dot,
    scaled,
    transposed_matvec,
    transposed_product,
)
from contactsense.robots.jit.kernel import inlined_fused_kernel
from contactsense.robots.vectors import Vector

Factors = tuple[Vector, Vector, float]
"""L D L^T of a symmetric positive definite matrix: L below its diagonal (10, 20, 21), 1 / D, and the
determinant."""


@inlined_fused_kernel
def factored(K: Block) -> Factors:
    """Factors of the matrix whose lower triangle is given."""
    d0 = K[0][0]
    i0 = 1.0 / d0
    l10, l20 = K[1][0] * i0, K[2][0] * i0
    d1 = K[1][1] - l10 * K[1][0]
    i1 = 1.0 / d1
    u21 = K[2][1] - l20 * K[1][0]
    l21 = u21 * i1
    d2 = K[2][2] - l20 * K[2][0] - l21 * u21
    return (l10, l20, l21), (i0, i1, 1.0 / d2), d0 * d1 * d2


@inlined_fused_kernel
def solved(P: Factors, b: Vector) -> Vector:
    """K^-1 b."""
    L, inverse = P[0], P[1]
    y1 = b[1] - L[0] * b[0]
    y2 = b[2] - L[1] * b[0] - L[2] * y1
    x2 = inverse[2] * y2
    x1 = inverse[1] * y1 - L[2] * x2
    return inverse[0] * b[0] - L[0] * x1 - L[1] * x2, x1, x2


@inlined_fused_kernel
def solved_block(P: Factors, B: Block) -> Block:
    """K^-1 B."""
    p = solved(P, (B[0][0], B[1][0], B[2][0]))
    q = solved(P, (B[0][1], B[1][1], B[2][1]))
    r = solved(P, (B[0][2], B[1][2], B[2][2]))
    return (p[0], q[0], r[0]), (p[1], q[1], r[1]), (p[2], q[2], r[2])


@inlined_fused_kernel
def with_prior(M: Block, information: float) -> Block:
    """M + information."""
    return (
        (M[0][0] + information, M[0][1], M[0][2]),
        (M[1][0], M[1][1] + information, M[1][2]),
        (M[2][0], M[2][1], M[2][2] + information),
    )


@inlined_fused_kernel
def without_moment(
    F: Block, D: Block, M: Block, hf: Vector, hm: Vector, information: float
) -> tuple[Block, Block, Block, Vector, Vector, float, float, Factors]:
    """Eliminate an additional moment with a normal prior from the information about a wrench.

    Args:
        F, D, M: Blocks of the information matrix, see `contactsense.kinematics.wrench_information`.
        hf, hm: The matrix times the most likely wrench.
        information: Inverse variance of each component of the moment [1/(Nm)^2].

    Returns:
        The same without the moment, five values; what the log likelihood gains by it, without the
        determinant; the determinant, relative to that of the prior; and the factors of M + information.
    """
    U = factored(with_prior(M, information))
    UD, UM, u = solved_block(U, D), solved_block(U, M), solved(U, hm)
    a = transposed_matvec(D, u)
    return (
        difference(F, transposed_product(D, UD)),
        scaled(UD, information),
        # M - M U^-1 M without the difference.
        scaled(UM, information),
        (hf[0] - a[0], hf[1] - a[1], hf[2] - a[2]),
        (information * u[0], information * u[1], information * u[2]),
        0.5 * dot(hm, u),
        U[2] / (information * information * information),
        U,
    )


@inlined_fused_kernel
def force_precision(F: Block, n: Vector, deviations: tuple[float, float]) -> Block:
    """Information matrix of a force with a normal prior; its lower triangle is valid.

    Args:
        F: What the measurement tells about it.
        n: Outward unit normal.
        deviations: Prior standard deviations along the normal and along the tangents [N].
    """
    across = 1.0 / (deviations[1] * deviations[1])
    excess = 1.0 / (deviations[0] * deviations[0]) - across
    return (
        (F[0][0] + across + excess * n[0] * n[0], F[0][1], F[0][2]),
        (F[1][0] + excess * n[1] * n[0], F[1][1] + across + excess * n[1] * n[1], F[1][2]),
        (
            F[2][0] + excess * n[2] * n[0],
            F[2][1] + excess * n[2] * n[1],
            F[2][2] + across + excess * n[2] * n[2],
        ),
    )
