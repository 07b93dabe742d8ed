"""Forces of two contacts near samples, and the sum of their wrenches: the normal distribution given the
measurement, in the model of `contactsense.multi_contact.likelihood.sample_likelihood`."""

import numpy as np

from contactsense.kinematics.linalg.cholesky import substitute_lower
from contactsense.multi_contact.likelihood.link_information import log_likelihood
from contactsense.multi_contact.likelihood.sample_likelihood import (
    SampleModel,
    add_sample_covariance,
    copy_lower,
    force_deviations,
    weight_innovation,
)
from contactsense.multi_contact.memory.buffers import Explanations, SeedingBuffers
from contactsense.robots.jit.kernel import fused_kernel


@fused_kernel
def fill_pair_wrench(
    model: SampleModel,
    samples: tuple[int, int],
    seeding: SeedingBuffers,
    explanations: Explanations,
    t: int,
) -> None:
    """Most likely forces, energy, and sum of the wrenches of explanation t, with its covariance.

    Args:
        model, seeding: As for `contactsense.multi_contact.seeding.seed_search.find_seeds`, without known
            contacts.
        samples: Indices of the samples.
        explanations: Filled in row t.
    """
    rows, m = model.measurement
    F, z = seeding.factor, seeding.weighted_innovation
    copy_lower(m, seeding.prior_covariance, F)
    for i in range(2):
        add_sample_covariance(model, samples[i], seeding, F)
    log_likelihood(m, seeding)
    explanations.energy[t] = 0.0
    for r in range(m):
        explanations.energy[t] += 0.5 * z[r] * z[r]
    weight_innovation(m, seeding)
    deviations = force_deviations(model.force_scale, model.friction_ratio)
    wrench, covariance = explanations.wrench[t], explanations.wrench_covariance[t]
    wrench[:] = 0.0
    covariance[:] = 0.0
    seeding.wrench_root[:] = 0.0
    for i in range(2):
        link = model.samples.link[samples[i]]
        _fill_wrench_prior(
            seeding.point_normal[samples[i]], deviations, seeding.moment_deviation[link], seeding.wrench_prior
        )
        _add_wrench(rows.matrix[link], m, seeding, wrench, covariance, explanations.force[t, i])
    _subtract_measured(m, F, seeding.wrench_root, covariance)


@fused_kernel
def _fill_wrench_prior(
    point_normal: np.ndarray, deviations: tuple[float, float], moment_deviation: float, out: np.ndarray
) -> None:
    """Prior covariance of the wrench of a contact near a sample, about the base origin, shape (6, 6).

    Arguments as for a contact in `contactsense.multi_contact.likelihood.sample_likelihood`.
    """
    x, y, z = point_normal[0], point_normal[1], point_normal[2]
    across = deviations[1] * deviations[1]
    excess = deviations[0] * deviations[0] - across
    for k in range(3):
        for a in range(3):
            out[a, k] = excess * point_normal[3 + a] * point_normal[3 + k] + (across if a == k else 0.0)
    # A moment is c x f: of each column of the forces', then of each row of what that gives.
    for k in range(3):
        u, v, w = out[0, k], out[1, k], out[2, k]
        out[3, k], out[4, k], out[5, k] = y * w - z * v, z * u - x * w, x * v - y * u
    for k in range(3, 6):
        u, v, w = out[k, 0], out[k, 1], out[k, 2]
        out[0, k], out[1, k], out[2, k] = u, v, w
        out[3, k], out[4, k], out[5, k] = y * w - z * v, z * u - x * w, x * v - y * u
        out[k, k] += moment_deviation * moment_deviation


@fused_kernel
def _add_wrench(
    A: np.ndarray,
    m: int,
    seeding: SeedingBuffers,
    wrench: np.ndarray,
    covariance: np.ndarray,
    force: np.ndarray,
) -> None:
    """Add a contact's most likely wrench, and its covariances: with itself, and with the rows.

    Args:
        A, m: Rows of its link, and their number.
        seeding: With the contact in `wrench_prior`, after `weight_innovation`.
        wrench, covariance: Those of the sum.
        force: Filled: its most likely force, shape (3,).
    """
    V, x, G = seeding.wrench_prior, seeding.weighted_innovation, seeding.wrench_root
    for k in range(6):
        likely = 0.0
        for r in range(m):
            g = 0.0
            for a in range(6):
                g += A[r, a] * V[a, k]
            G[r, k] += g
            likely += g * x[r]
        wrench[k] += likely
        if k < 3:
            force[k] = likely
        for a in range(6):
            covariance[a, k] += V[a, k]


@fused_kernel
def _subtract_measured(m: int, F: np.ndarray, G: np.ndarray, covariance: np.ndarray) -> None:
    """Subtract G^T S^-1 G from a covariance, with the factor F of S, shape (m, m); G, shape (m, 6), is
    overwritten."""
    substitute_lower(F, m, G, 6)
    for r in range(m):
        for a in range(6):
            for k in range(6):
                covariance[a, k] -= G[r, a] * G[r, k]
