"""What a measurement tells of a further contact on each link, and the likelihood of one near each sample.

Given the noise and the other contacts, the rows are y = A w + e for a further contact with the wrench w on a
link with rows A, and e is normal with covariance S. Everything about w is in six numbers and a 6x6 matrix,

    h = A^T S^-1 y,    L = A^T S^-1 A,    log p(y | w) = constant + h . w - 1/2 w . L w.

A contact near a sample c has the wrench w = (f, c x f + m), with a normal prior of the force f, and of a
moment m that allows for the distance between samples. Its likelihood is that of six unknowns: one 6x6 system
of equations, solved for a block of samples at a time, one in each SIMD lane.
"""

import math

import numpy as np

from contactsense.kinematics.linalg.cholesky import cholesky
from contactsense.kinematics.linalg.ldl import ldl_solve_unrolled
from contactsense.kinematics.wrench_information import blocks, shift_information
from contactsense.localization.simd_layout import LANES
from contactsense.multi_contact.buffers import (
    DET,
    GAIN,
    NORMAL_FORCE,
    NX,
    NY,
    NZ,
    SPREAD,
    MeasurementRows,
    SeedingBuffers,
    X,
    Y,
    Z,
)
from contactsense.multi_contact.seed_samples import SeedSamples
from contactsense.robots.jit.kernel import fused_kernel


@fused_kernel
def log_likelihood(m: int, seeding: SeedingBuffers) -> float:
    """Log likelihood (up to a constant) of the innovation under the covariance in `seeding.factor`.

    Factors the covariance and does the forward substitution into `weighted_innovation`.
    """
    L, y, z = seeding.factor, seeding.innovation, seeding.weighted_innovation
    total: float = -0.5 * cholesky(L, m)
    for r in range(m):
        x = y[r]
        for s in range(r):
            x -= L[r, s] * z[s]
        z[r] = x / L[r, r]
        total -= 0.5 * z[r] * z[r]
    return total


@fused_kernel
def fill_link_information(rows: MeasurementRows, m: int, seeding: SeedingBuffers) -> float:
    """Fill `seeding.link_information` and `seeding.link_vector`: L and h of every link.

    Args:
        rows, m: The measurement and the number of its rows.
        seeding: With the covariance S in `factor`, lower triangle, which is factored.

    Returns:
        Log likelihood without a further contact, up to a constant.
    """
    score = log_likelihood(m, seeding)
    F, W, z = seeding.factor, seeding.whitened, seeding.weighted_innovation
    links = rows.seen.shape[0]
    columns = 6 * links
    for r in range(m):
        for link in range(links):
            for k in range(6):
                W[r, 6 * link + k] = rows.matrix[link, r, k]
        for s in range(r):
            x = F[r, s]
            for c in range(columns):
                W[r, c] -= x * W[s, c]
        x = 1.0 / F[r, r]
        for c in range(columns):
            W[r, c] *= x
    for link in range(links):
        L, h = seeding.link_information[link], seeding.link_vector[link]
        at = 6 * link
        for a in range(6):
            for b in range(a + 1):
                x = 0.0
                for r in range(m):
                    x += W[r, at + a] * W[r, at + b]
                L[a, b] = x
                L[b, a] = x
            x = 0.0
            for r in range(m):
                x += W[r, at + a] * z[r]
            h[a] = x
    return score


@fused_kernel
def fill_sample_blocks(seed_samples: SeedSamples, moment_scale: float, seeding: SeedingBuffers) -> None:
    """Fill `seeding.block` with the places of the coarse samples.

    Args:
        seed_samples: The samples.
        moment_scale: Standard deviation of the additional moment, relative to the spread of a sample [N].
        seeding: With the samples in the base frame in `point_normal`.
    """
    chosen = seed_samples.coarse
    for b in range(chosen.link.shape[0]):
        block = seeding.block[b]
        for j in range(LANES):
            i = chosen.sample[b, j]
            c = seeding.point_normal[i]
            block[X + j], block[Y + j], block[Z + j] = c[0], c[1], c[2]
            block[NX + j], block[NY + j], block[NZ + j] = c[3], c[4], c[5]
            block[SPREAD + j] = seed_samples.spread[i] * moment_scale


@fused_kernel
def likelihood_near_samples(
    L: np.ndarray, h: np.ndarray, deviations: tuple[float, float], block: np.ndarray
) -> None:
    """Likelihood of a contact near each sample of a block.

    Fills `GAIN`, `DET` and `NORMAL_FORCE`. The log likelihood exceeds that without this contact by
    GAIN - 1/2 log(DET), where DET is at least one; the most likely force pushes with `NORMAL_FORCE` [N].

    Args:
        L, h: Of the block's link, see `fill_link_information`.
        deviations: Standard deviations of the force along the normal and along the tangents [N].
        block: A block of `fill_sample_blocks`.
    """
    F, D, M = blocks(L)
    h0, h1, h2, h3, h4, h5 = h[0], h[1], h[2], h[3], h[4], h[5]
    normal_variance, tangential_variance = deviations[0] * deviations[0], deviations[1] * deviations[1]
    tangential = 1.0 / tangential_variance
    excess = 1.0 / normal_variance - tangential
    force_volume = normal_variance * tangential_variance * tangential_variance
    for j in range(LANES):
        x, y, z = block[X + j], block[Y + j], block[Z + j]
        n0, n1, n2 = block[NX + j], block[NY + j], block[NZ + j]
        moment_variance = block[SPREAD + j] * block[SPREAD + j]
        moment = 1.0 / moment_variance
        A, B, C = shift_information(F, D, M, x, y, z)
        det, _, gain, _, _, _, f0, f1, f2, _, _, _ = ldl_solve_unrolled(
            A[0][0] + tangential + excess * n0 * n0,
            A[0][1] + excess * n0 * n1,
            A[0][2] + excess * n0 * n2,
            B[0][0],
            B[1][0],
            B[2][0],
            A[1][1] + tangential + excess * n1 * n1,
            A[1][2] + excess * n1 * n2,
            B[0][1],
            B[1][1],
            B[2][1],
            A[2][2] + tangential + excess * n2 * n2,
            B[0][2],
            B[1][2],
            B[2][2],
            C[0][0] + moment,
            C[0][1],
            C[0][2],
            C[1][1] + moment,
            C[1][2],
            C[2][2] + moment,
            h0 + h4 * z - h5 * y,
            h1 + h5 * x - h3 * z,
            h2 + h3 * y - h4 * x,
            h3,
            h4,
            h5,
        )
        block[GAIN + j] = gain
        block[DET + j] = det * force_volume * moment_variance * moment_variance * moment_variance
        block[NORMAL_FORCE + j] = -(f0 * n0 + f1 * n1 + f2 * n2)


@fused_kernel
def log_gain(block: np.ndarray, j: int) -> float:
    """Log likelihood of a contact near sample j of a block, above that without it."""
    return float(block[GAIN + j] - 0.5 * math.log(block[DET + j]))
