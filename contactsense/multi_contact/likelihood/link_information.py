"""What a measurement tells of a further contact on each link, and the likelihood of one near each sample.

Given the noise and the other contacts, the rows are y = A w + e for a further contact with the wrench w on a
link with rows A, and e is normal with covariance S. Everything about w is in six numbers and a 6x6 matrix,

    h = A^T S^-1 y,    L = A^T S^-1 A,    log p(y | w) = constant + h . w - 1/2 w . L w.

A contact near a sample c has the wrench w = (f, c x f + m), with a normal prior of the force f, and of a
moment m that allows for the distance between samples. That moment is eliminated first, for all samples of a
link; what remains is one 3x3 system of equations for the force, solved for a block of samples at a time, one
in each SIMD lane.
"""

import math

import numpy as np

from contactsense.kinematics.linalg.cholesky import cholesky, substitute_lower
from contactsense.kinematics.wrench_information import Block, blocks, dot, shift_information, shift_vector
from contactsense.multi_contact.likelihood.force_information import (
    factored,
    force_precision,
    solved,
    without_moment,
)
from contactsense.multi_contact.memory.buffers import Measurement, SeedingBuffers
from contactsense.multi_contact.memory.sample_layout import DET, GAIN, NORMAL_FORCE, NX, NY, NZ, X, Y, Z
from contactsense.multi_contact.memory.seed_samples import SeedSamples
from contactsense.robots.jit.kernel import fused_kernel, inlined_fused_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.vectors import Vector


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
def fill_link_information(measurement: Measurement, seeding: SeedingBuffers) -> float:
    """Fill `seeding.link_information` and `seeding.link_vector`: L and h of every link.

    Args:
        measurement: The measurement.
        seeding: With the covariance S in `factor`, lower triangle, which is factored.

    Returns:
        Log likelihood without a further contact, up to a constant.
    """
    rows, m = measurement
    score = log_likelihood(m, seeding)
    F, W, z = seeding.factor, seeding.whitened, seeding.weighted_innovation
    links = rows.seen.shape[0]
    for r in range(m):
        for link in range(links):
            for k in range(6):
                W[r, 6 * link + k] = rows.matrix[link, r, k]
    substitute_lower(F, m, W, 6 * links)
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
def fill_sample_blocks(seed_samples: SeedSamples, seeding: SeedingBuffers) -> None:
    """Fill `seeding.block` with the places of the coarse samples.

    Args:
        seed_samples: The samples.
        seeding: With the samples in the base frame in `point_normal`.
    """
    chosen = seed_samples.coarse
    for b in range(chosen.link.shape[0]):
        block = seeding.block[b]
        for j in range(LANES):
            c = seeding.point_normal[chosen.sample[b, j]]
            block[X + j], block[Y + j], block[Z + j] = c[0], c[1], c[2]
            block[NX + j], block[NY + j], block[NZ + j] = c[3], c[4], c[5]


@fused_kernel
def likelihood_near_samples(
    L: np.ndarray, h: np.ndarray, deviations: tuple[float, float], moment_deviation: float, block: np.ndarray
) -> None:
    """Likelihood of a contact near each sample of a block.

    Fills `GAIN`, `DET` and `NORMAL_FORCE`. The log likelihood exceeds that without this contact by
    GAIN - 1/2 log(DET), where DET is at least one; the most likely force pushes with `NORMAL_FORCE` [N].

    Args:
        L, h: Of the block's link, see `fill_link_information`.
        deviations: Standard deviations of the force along the normal and along the tangents [N].
        moment_deviation: That of each component of the additional moment [Nm].
        block: A block of `fill_sample_blocks`.
    """
    F, D, M = blocks(L)
    F, D, M, hf, hm, gain, det, _ = without_moment(
        F, D, M, (h[0], h[1], h[2]), (h[3], h[4], h[5]), 1.0 / (moment_deviation * moment_deviation)
    )
    det *= force_volume(deviations)
    for j in range(LANES):
        c, n = (block[X + j], block[Y + j], block[Z + j]), (block[NX + j], block[NY + j], block[NZ + j])
        f, gain_of_force, det_of_force = force_near_sample(F, D, M, hf, hm, c, n, deviations)
        block[GAIN + j], block[DET + j] = gain + gain_of_force, det * det_of_force
        block[NORMAL_FORCE + j] = -dot(f, n)


@inlined_fused_kernel
def force_volume(deviations: tuple[float, float]) -> float:
    """Determinant of the prior covariance of a force, from its standard deviations along the normal and along
    the tangents."""
    normal, tangential = deviations
    return normal * normal * tangential * tangential * tangential * tangential


@inlined_fused_kernel
def force_near_sample(
    F: Block,
    D: Block,
    M: Block,
    hf: Vector,
    hm: Vector,
    c: Vector,
    n: Vector,
    deviations: tuple[float, float],
) -> tuple[Vector, float, float]:
    """The most likely force [N] near a sample c with the outward normal n, and what it adds to GAIN, and
    multiplies DET by, without `force_volume`.

    `F`, `D`, `M`, `hf`, `hm`: information on the wrench without the additional moment, see
    `contactsense.multi_contact.likelihood.force_information.without_moment`.
    """
    K = factored(force_precision(shift_information(F, D, M, c[0], c[1], c[2])[0], n, deviations))
    g = shift_vector(hf, hm, c[0], c[1], c[2])
    f = solved(K, g)
    return f, 0.5 * dot(g, f), K[2]


@fused_kernel
def log_gain(block: np.ndarray, j: int) -> float:
    """Log likelihood of a contact near sample j of a block, above that without it."""
    return float(block[GAIN + j] - 0.5 * math.log(block[DET + j]))
