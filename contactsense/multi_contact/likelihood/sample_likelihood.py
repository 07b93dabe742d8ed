"""Likelihood of contacts near surface samples, to choose where the search for several contacts begins.

A contact near a sample with an unknown pushing force makes the rows a Gaussian vector. Its covariance is
S = C Q C^T (C: derivative of the rows by a force there, Q: prior covariance of the force) plus a term for
the distance between samples. The covariances of several contacts add up, so that the likelihood of any
set of samples is that of one small Gaussian.
"""

from typing import NamedTuple

import numpy as np

from contactsense.kinematics.model import Motion
from contactsense.kinematics.spatial import Six
from contactsense.localization.surface.surface_samples import SurfaceSamples
from contactsense.multi_contact.likelihood.link_information import log_likelihood
from contactsense.multi_contact.memory.buffers import Measurement, SeedingBuffers
from contactsense.multi_contact.memory.seed_samples import SeedSamples
from contactsense.robots.jit.kernel import fused_kernel

RATIO_FACTOR = 2.0
"""Factor on the friction ratio of the prior in seeding, to allow for its heavy tail."""


class SampleModel(NamedTuple):
    """A measurement, and what is assumed of contacts near samples of the surface."""

    samples: SeedSamples
    measurement: Measurement
    friction_ratio: float
    """That of the prior."""
    force_scale: float
    """Approximate magnitude of the forces [N]."""


@fused_kernel
def transform_samples(
    samples: SurfaceSamples,
    depth: np.ndarray,
    motion: Motion,
    seed_samples: SeedSamples,
    seeding: SeedingBuffers,
) -> None:
    """Transform all samples to the base frame: fills `seeding.point_normal`."""
    for i in range(seed_samples.link.shape[0]):
        body = depth[seed_samples.link[i]]
        R, o, c, n = motion.rotation[body], motion.origin[body], samples.point[i], samples.normal[i]
        out = seeding.point_normal[i]
        for k in range(3):
            out[k] = o[k] + R[k, 0] * c[0] + R[k, 1] * c[1] + R[k, 2] * c[2]
            out[3 + k] = R[k, 0] * n[0] + R[k, 1] * n[1] + R[k, 2] * n[2]


@fused_kernel
def add_contact_covariance(
    measurement: Measurement,
    link: int,
    point_normal: Six,
    deviations: tuple[float, float],
    moment_deviation: float,
    force_jacobian: np.ndarray,
    normal_jacobian: np.ndarray,
    out: np.ndarray,
) -> None:
    """Add to `out` (lower triangle) the covariance of the rows due to a contact.

    Args:
        measurement: The measurement.
        link: The touched link.
        point_normal: Point and outward normal, base frame, six floats.
        deviations: Standard deviations of the force along the normal and along the tangents [N].
        moment_deviation: Standard deviation of each component of an additional moment [Nm].
        force_jacobian: Scratch: derivative of each row by the force, shape (M, 3).
        normal_jacobian: Filled: derivative of each row by a force along the normal, shape (M,).
        out: Shape (M, M).
    """
    rows, m = measurement
    A, seen = rows.matrix[link], rows.seen[link]
    cx, cy, cz, nx, ny, nz = point_normal
    tangential_variance = deviations[1] * deviations[1]
    normal_excess = deviations[0] * deviations[0] - tangential_variance
    moment_variance = moment_deviation * moment_deviation
    for r in range(m):
        normal_jacobian[r] = 0.0
        if seen[r] == 0.0:
            continue
        a, b = A[r], force_jacobian[r]
        # a . (f, c x f) = (a_f + a_m x c) . f
        b[0] = a[0] + a[4] * cz - a[5] * cy
        b[1] = a[1] + a[5] * cx - a[3] * cz
        b[2] = a[2] + a[3] * cy - a[4] * cx
        e = b[0] * nx + b[1] * ny + b[2] * nz
        normal_jacobian[r] = e
        for s in range(r + 1):
            if seen[s] == 0.0:
                continue
            d, v = force_jacobian[s], A[s]
            out[r, s] += (
                tangential_variance * (b[0] * d[0] + b[1] * d[1] + b[2] * d[2])
                + normal_excess * e * normal_jacobian[s]
                + moment_variance * (a[3] * v[3] + a[4] * v[4] + a[5] * v[5])
            )


@fused_kernel
def force_deviations(force_scale: float, friction_ratio: float) -> tuple[float, float]:
    """Standard deviations of a force along the normal and along the tangents [N]."""
    return force_scale, RATIO_FACTOR * friction_ratio * force_scale


@fused_kernel
def add_sample_covariance(model: SampleModel, i: int, seeding: SeedingBuffers, out: np.ndarray) -> None:
    """`add_contact_covariance` for a contact at sample i."""
    c = seeding.point_normal[i]
    point_normal = (c[0], c[1], c[2], c[3], c[4], c[5])
    link = model.samples.link[i]
    add_contact_covariance(
        model.measurement,
        link,
        point_normal,
        force_deviations(model.force_scale, model.friction_ratio),
        model.samples.spread[link] * model.force_scale,
        seeding.force_jacobian,
        seeding.normal_jacobian[i],
        out,
    )


@fused_kernel
def weight_innovation(m: int, seeding: SeedingBuffers) -> None:
    """Back substitution after `log_likelihood`: inverse covariance times innovation."""
    L, z = seeding.factor, seeding.weighted_innovation
    for r in range(m - 1, -1, -1):
        x = z[r]
        for s in range(r + 1, m):
            x -= L[s, r] * z[s]
        z[r] = x / L[r, r]


@fused_kernel
def is_pushing(m: int, seeding: SeedingBuffers, sample: int) -> bool:
    """Whether the most likely force at a sample pushes, after `weight_innovation`."""
    x = 0.0
    for r in range(m):
        x += seeding.normal_jacobian[sample, r] * seeding.weighted_innovation[r]
    return x < 0.0


@fused_kernel
def copy_lower(m: int, a: np.ndarray, out: np.ndarray) -> None:
    """Copy the lower triangle of a symmetric matrix, shape (m, m)."""
    for r in range(m):
        for s in range(r + 1):
            out[r, s] = a[r, s]


@fused_kernel
def initial_forces(model: SampleModel, s: int, count: int, seeding: SeedingBuffers, out: np.ndarray) -> None:
    """Most likely forces at the samples of a seed, base axes, shape (>= count, 3) [N]."""
    (rows, m), force_scale = model.measurement, model.force_scale
    copy_lower(m, seeding.prior_covariance, seeding.factor)
    for e in range(count):
        add_sample_covariance(model, seeding.seed[s, e], seeding, seeding.factor)
    log_likelihood(m, seeding)
    weight_innovation(m, seeding)
    tangential_variance = (RATIO_FACTOR * model.friction_ratio * force_scale) ** 2
    for e in range(count):
        i = seeding.seed[s, e]
        link = model.samples.link[i]
        c = seeding.point_normal[i]
        c0, c1, c2, n0, n1, n2 = c[0], c[1], c[2], c[3], c[4], c[5]
        b0, b1, b2 = 0.0, 0.0, 0.0
        for r in range(m):
            a, x = rows.matrix[link, r], seeding.weighted_innovation[r]
            b0 += x * (a[0] + a[4] * c2 - a[5] * c1)
            b1 += x * (a[1] + a[5] * c0 - a[3] * c2)
            b2 += x * (a[2] + a[3] * c1 - a[4] * c0)
        normal_part = (force_scale * force_scale - tangential_variance) * (b0 * n0 + b1 * n1 + b2 * n2)
        out[e, 0], out[e, 1], out[e, 2] = (
            tangential_variance * b0 + normal_part * n0,
            tangential_variance * b1 + normal_part * n1,
            tangential_variance * b2 + normal_part * n2,
        )
