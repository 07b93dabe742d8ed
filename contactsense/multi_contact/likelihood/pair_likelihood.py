"""Likelihood of two contacts near samples of the surface: eight first contacts at a time, one in each SIMD
lane, each beside all second contacts.

Everything about both wrenches is in the information matrix of
`contactsense.multi_contact.likelihood.link_information`. The moments that allow for the distance between
samples do not depend on the places, so they are eliminated for a pair of links; what remains of a pair of
samples are their forces, three unknowns each. Eliminating the force of the first gives the information on the
wrench of the second, for each link once. Its likelihood near each sample is then one 3x3 system of equations.
"""

import math

import numpy as np

from contactsense.kinematics.wrench_information import (
    Block,
    blocks,
    difference,
    dot,
    scaled,
    shift_information,
    shift_vector,
    transposed_matvec,
    transposed_product,
)

from contactsense.multi_contact.memory.pair_layout import (  # isort: skip
    CX, CY, CZ, D00, D01, D02, D10, D11, D12, D20, D21, D22, F0, F00, F1, F10, F11, F2, F20, F21, F22,
    FIRST_DET, FIRST_GAIN, H0, H1, H2, H3, H4, H5, M00, M10, M11, M20, M21, M22, MX, MY, MZ, P0, P1, P10,
    P2, P20, P21, PAIR_DET, PAIR_FORCE, PAIR_GAIN, PAIRS, PUSH, Q0, Q1, Q2, Q3, Q4, Q5, SECOND_DET,
    SECOND_GAIN,
)  # fmt: skip
from contactsense.multi_contact.likelihood.force_information import (
    factored,
    force_precision,
    solved,
    solved_block,
    with_prior,
    without_moment,
)
from contactsense.multi_contact.likelihood.link_information import force_near_sample, force_volume
from contactsense.multi_contact.memory.buffers import SeedingBuffers
from contactsense.multi_contact.memory.sample_layout import (
    DET,
    GAIN,
    HIGHEST,
    NORMAL_FORCE,
    NX,
    NY,
    NZ,
    X,
    Y,
    Z,
)
from contactsense.robots.jit.kernel import fused_kernel, inlined_fused_kernel
from contactsense.robots.jit.lanes import LANES


@fused_kernel
def fill_cross_information(m: int, seeding: SeedingBuffers) -> None:
    """Fill `seeding.cross_information`: A_k^T S^-1 A_l of all links k >= l, after `fill_link_information`."""
    W, out = seeding.whitened, seeding.cross_information
    for k in range(out.shape[0]):
        for a in range(6):
            row = out[k, a]
            for c in range(6 * k + 6):
                row[c] = 0.0
            for r in range(m):
                x = W[r, 6 * k + a]
                for c in range(6 * k + 6):
                    row[c] += x * W[r, c]


@fused_kernel
def take_first_contacts(b: int, link: int, deviations: tuple[float, float], seeding: SeedingBuffers) -> None:
    """Fill `seeding.first` with the contacts of `seeding.block[b]`, their moments eliminated, and their most
    likely forces alone.

    Args:
        b, link: The block, and its link.
        deviations: Standard deviations of the force along the normal and along the tangents [N].
        seeding: After `fill_cross_information`, with `moment_deviation`.
    """
    block, first, h = seeding.block[b], seeding.first, seeding.link_vector[link]
    for q in range(6 * LANES):
        # `CX` to `MZ` are `X` to `NZ`.
        first[CX + q] = block[X + q]
    A, B, C = blocks(seeding.link_information[link])
    F, D, M, hf, hm, gain, det, _ = without_moment(
        A, B, C, (h[0], h[1], h[2]), (h[3], h[4], h[5]), 1.0 / seeding.moment_deviation[link] ** 2
    )
    volume = force_volume(deviations)
    for j in range(LANES):
        x, y, z = first[CX + j], first[CY + j], first[CZ + j]
        K = force_precision(
            shift_information(F, D, M, x, y, z)[0], (first[MX + j], first[MY + j], first[MZ + j]), deviations
        )
        g = shift_vector(hf, hm, x, y, z)
        P = factored(K)
        f = solved(P, g)
        first[P10 + j], first[P20 + j], first[P21 + j] = P[0]
        first[P0 + j], first[P1 + j], first[P2 + j] = P[1]
        first[F0 + j], first[F1 + j], first[F2 + j] = f
        first[FIRST_GAIN + j] = gain + 0.5 * dot(g, f)
        first[FIRST_DET + j] = det * volume * P[2]


@inlined_fused_kernel
def _cross_blocks(X: np.ndarray, at: int) -> tuple[Block, Block, Block, Block]:
    """The 3x3 blocks of six columns of a matrix of six rows: force by force, force by moment, moment by
    force, moment by moment."""
    a, b, c, d, e = at + 1, at + 2, at + 3, at + 4, at + 5
    return (
        ((X[0, at], X[0, a], X[0, b]), (X[1, at], X[1, a], X[1, b]), (X[2, at], X[2, a], X[2, b])),
        ((X[0, c], X[0, d], X[0, e]), (X[1, c], X[1, d], X[1, e]), (X[2, c], X[2, d], X[2, e])),
        ((X[3, at], X[3, a], X[3, b]), (X[4, at], X[4, a], X[4, b]), (X[5, at], X[5, a], X[5, b])),
        ((X[3, c], X[3, d], X[3, e]), (X[4, c], X[4, d], X[4, e]), (X[5, c], X[5, d], X[5, e])),
    )


@fused_kernel
def condition_on_first(own: int, link: int, seeding: SeedingBuffers) -> None:
    """Information on a second contact on a link, given each of the first contacts: fills `F00` to
    `SECOND_DET`.

    Args:
        own, link: Link of the first contacts, and of the second.
        seeding: After `take_first_contacts`.
    """
    first = seeding.first
    _, B, C = blocks(seeding.link_information[own])
    h = seeding.link_vector[own]
    moment = 1.0 / seeding.moment_deviation[own] ** 2
    U = factored(with_prior(C, moment))
    F, D, M = blocks(seeding.link_information[link])
    k = seeding.link_vector[link]
    hf, hm = (k[0], k[1], k[2]), (k[3], k[4], k[5])
    Xff, Xfm, Xmf, Xmm = _cross_blocks(seeding.cross_information[own], 6 * link)
    # Without the moment of the first contact.
    Uf, Um, u = solved_block(U, Xmf), solved_block(U, Xmm), solved(U, (h[3], h[4], h[5]))
    Xff = difference(Xff, transposed_product(B, Uf))
    Xfm = difference(Xfm, transposed_product(B, Um))
    F = difference(F, transposed_product(Xmf, Uf))
    D = difference(D, transposed_product(Xmm, Uf))
    M = difference(M, transposed_product(Xmm, Um))
    a, b = transposed_matvec(Xmf, u), transposed_matvec(Xmm, u)
    hf, hm = (hf[0] - a[0], hf[1] - a[1], hf[2] - a[2]), (hm[0] - b[0], hm[1] - b[1], hm[2] - b[2])
    Xmf, Xmm = scaled(Uf, moment), scaled(Um, moment)
    second_moment = 1.0 / seeding.moment_deviation[link] ** 2
    for j in range(LANES):
        x, y, z = first[CX + j], first[CY + j], first[CZ + j]
        n = (first[MX + j], first[MY + j], first[MZ + j])
        f = (first[F0 + j], first[F1 + j], first[F2 + j])
        P = (
            (first[P10 + j], first[P20 + j], first[P21 + j]),
            (first[P0 + j], first[P1 + j], first[P2 + j]),
            1.0,
        )
        Zf, Zm = _minus_cross(x, y, z, Xff, Xmf), _minus_cross(x, y, z, Xfm, Xmm)
        Yf, Ym = solved_block(P, Zf), solved_block(P, Zm)
        a, b = transposed_matvec(Zf, f), transposed_matvec(Zm, f)
        G, E, N, gf, gm, gain, det, V = without_moment(
            difference(F, transposed_product(Zf, Yf)),
            difference(D, transposed_product(Zm, Yf)),
            difference(M, transposed_product(Zm, Ym)),
            (hf[0] - a[0], hf[1] - a[1], hf[2] - a[2]),
            (hm[0] - b[0], hm[1] - b[1], hm[2] - b[2]),
            second_moment,
        )
        first[F00 + j], first[F10 + j], first[F11 + j] = G[0][0], G[1][0], G[1][1]
        first[F20 + j], first[F21 + j], first[F22 + j] = G[2]
        first[D00 + j], first[D01 + j], first[D02 + j] = E[0]
        first[D10 + j], first[D11 + j], first[D12 + j] = E[1]
        first[D20 + j], first[D21 + j], first[D22 + j] = E[2]
        first[M00 + j], first[M10 + j], first[M11 + j] = N[0][0], N[1][0], N[1][1]
        first[M20 + j], first[M21 + j], first[M22 + j] = N[2]
        first[H0 + j], first[H1 + j], first[H2 + j] = gf
        first[H3 + j], first[H4 + j], first[H5 + j] = gm
        first[SECOND_GAIN + j], first[SECOND_DET + j] = gain, det
        # The first force along its normal, n . (f - Y w), with the most likely moment of the second contact.
        qf, qm = transposed_matvec(Yf, n), transposed_matvec(Ym, n)
        v = solved(V, qm)
        # D has the moment in its rows; the moment given the wrench is V^-1 (h - D f - M c x f).
        first[PUSH + j] = dot(qm, solved(V, (hm[0] - b[0], hm[1] - b[1], hm[2] - b[2]))) - dot(n, f)
        Dq = transposed_matvec(difference(D, transposed_product(Zm, Yf)), v)
        first[Q0 + j], first[Q1 + j], first[Q2 + j] = Dq[0] - qf[0], Dq[1] - qf[1], Dq[2] - qf[2]
        first[Q3 + j], first[Q4 + j], first[Q5 + j] = (
            -second_moment * v[0],
            -second_moment * v[1],
            -second_moment * v[2],
        )


@fused_kernel
def fill_pair_likelihoods(
    filled: int,
    lanes: int,
    deviations: tuple[float, float],
    first: np.ndarray,
    block: np.ndarray,
    pairs: np.ndarray,
) -> float:
    """Likelihood of each pair of a first contact and a second one near a sample of a block.

    As `contactsense.multi_contact.likelihood.link_information.likelihood_near_samples`, with what the first
    contact adds.

    Args:
        filled: Number of first contacts.
        lanes: Number of samples of the block; 0 if it is that of the first contacts, each of which has the
            samples before it.
        deviations: Standard deviations of the force along the normal and along the tangents [N].
        first: After `condition_on_first`.
        block: Of the second contact's link.
        pairs: Filled, see `contactsense.multi_contact.memory.pair_layout`.

    Returns:
        The highest gain.
    """
    for i in range(filled * LANES, PAIRS):
        pairs[PAIR_GAIN + i], pairs[PAIR_DET + i], pairs[PAIR_FORCE + i] = -math.inf, 1.0, 0.0
    for e in range(LANES):
        block[HIGHEST + e] = -math.inf
    for j in range(filled):
        _fill_pairs_of_first(j, lanes if lanes > 0 else j, deviations, first, block, pairs)
    highest: float = block[HIGHEST]
    for e in range(1, LANES):
        highest = max(highest, block[HIGHEST + e])
    return highest


@fused_kernel
def _fill_pairs_of_first(
    j: int,
    lanes: int,
    deviations: tuple[float, float],
    first: np.ndarray,
    block: np.ndarray,
    pairs: np.ndarray,
) -> None:
    """The pairs of the j-th first contact and the first `lanes` samples; arguments as above."""
    F = (
        (first[F00 + j], first[F10 + j], first[F20 + j]),
        (first[F10 + j], first[F11 + j], first[F21 + j]),
        (first[F20 + j], first[F21 + j], first[F22 + j]),
    )
    D = (
        (first[D00 + j], first[D01 + j], first[D02 + j]),
        (first[D10 + j], first[D11 + j], first[D12 + j]),
        (first[D20 + j], first[D21 + j], first[D22 + j]),
    )
    M = (
        (first[M00 + j], first[M10 + j], first[M20 + j]),
        (first[M10 + j], first[M11 + j], first[M21 + j]),
        (first[M20 + j], first[M21 + j], first[M22 + j]),
    )
    hf, hm = (first[H0 + j], first[H1 + j], first[H2 + j]), (first[H3 + j], first[H4 + j], first[H5 + j])
    qf, qm = (first[Q0 + j], first[Q1 + j], first[Q2 + j]), (first[Q3 + j], first[Q4 + j], first[Q5 + j])
    push = first[PUSH + j]
    gain = first[FIRST_GAIN + j] + first[SECOND_GAIN + j]
    det = first[FIRST_DET + j] * first[SECOND_DET + j] * force_volume(deviations)
    # Within the block, as the compiler cannot tell that another array does not share its memory.
    for e in range(LANES):
        x, y, z = block[X + e], block[Y + e], block[Z + e]
        n = (block[NX + e], block[NY + e], block[NZ + e])
        f, gain_of_force, det_of_force = force_near_sample(F, D, M, hf, hm, (x, y, z), n, deviations)
        gain_of_pair = gain + gain_of_force if e < lanes else -math.inf
        block[GAIN + e] = gain_of_pair
        block[HIGHEST + e] = max(block[HIGHEST + e], gain_of_pair)
        block[DET + e] = det * det_of_force
        block[NORMAL_FORCE + e] = min(-dot(f, n), push - dot(shift_vector(qf, qm, x, y, z), f))
    at = j * LANES
    for e in range(LANES):
        pairs[PAIR_GAIN + at + e] = block[GAIN + e]
    for e in range(LANES):
        pairs[PAIR_DET + at + e] = block[DET + e]
    for e in range(LANES):
        pairs[PAIR_FORCE + at + e] = block[NORMAL_FORCE + e]


@inlined_fused_kernel
def _minus_cross(x: float, y: float, z: float, A: Block, B: Block) -> Block:
    """A - [c]x B with c = (x, y, z)."""
    return (
        (
            A[0][0] - y * B[2][0] + z * B[1][0],
            A[0][1] - y * B[2][1] + z * B[1][1],
            A[0][2] - y * B[2][2] + z * B[1][2],
        ),
        (
            A[1][0] - z * B[0][0] + x * B[2][0],
            A[1][1] - z * B[0][1] + x * B[2][1],
            A[1][2] - z * B[0][2] + x * B[2][2],
        ),
        (
            A[2][0] - x * B[1][0] + y * B[0][0],
            A[2][1] - x * B[1][1] + y * B[0][1],
            A[2][2] - x * B[1][2] + y * B[0][2],
        ),
    )
