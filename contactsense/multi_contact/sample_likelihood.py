"""Likelihood of contacts near surface samples, to choose where the search for several contacts begins.

A contact near a sample with an unknown pushing force makes the rows a Gaussian vector. Its covariance is
S = C Q C^T (C: derivative of the rows by a force there, Q: prior covariance of the force) plus a term for
the distance between samples. The covariances of several contacts add up, so that the likelihood of any
set of samples is that of one small Gaussian.
"""

import math

import numpy as np

from contactsense.kinematics.model import Motion
from contactsense.kinematics.spatial import Six
from contactsense.localization.surface_samples import SurfaceSamples
from contactsense.multi_contact.buffers import (
    PLACES,
    UNKNOWNS,
    JointState,
    KnownPriorScratch,
    MeasurementRows,
    MultiContactBuffers,
    SeedingBuffers,
)
from contactsense.multi_contact.contact_step import vector_of
from contactsense.multi_contact.joint_layout import FX, NX, PX, W0
from contactsense.multi_contact.known_rows import Change, unknown_of_factor
from contactsense.multi_contact.link_information import log_likelihood
from contactsense.multi_contact.seed_samples import SeedSamples
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.vectors import norm
from contactsense.sensors.usable_sensors import Usable

RATIO_FACTOR = 2.0
"""Factor on the friction ratio of the prior in seeding, to allow for its heavy tail."""
TORQUE_LEVER = 0.5
"""Lever arm that converts a torque to a force if there is no base sensor [m]."""
MIN_FORCE = 1.0
"""Lower bound of the force scale [N]."""


@fused_kernel
def estimate_force_scale(external: tuple[np.ndarray, np.ndarray, np.ndarray], present: Usable) -> float:
    """Approximate magnitude of the contact forces [N].

    Arguments as for `contactsense.multi_contact.measurement_rows.fill_measurement_rows`.
    """
    force_scale = MIN_FORCE
    if present[0]:
        y = external[0]
        force_scale = max(force_scale, math.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2]))
    for s in range(external[2].shape[0]):
        if present[2] >> s & 1:
            y = external[2][s]
            force_scale = max(force_scale, math.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2]))
    if present[1]:
        for j in range(external[1].shape[0]):
            force_scale = max(force_scale, abs(external[1][j]) / TORQUE_LEVER)
    return force_scale


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
def initialize_seeding(
    links: np.ndarray,
    friction_ratio: float,
    buffers: MultiContactBuffers,
    known_count: int,
    change: Change,
    force_scale: float,
    m: int,
) -> None:
    """Covariance of the rows due to noise and known contacts, and the innovation over their known forces.

    The places of known contacts are taken for independent of their forces, and the moment that they leave
    open for the same about all axes. That is more than the covariances of a normal distribution, and allows
    for what it does not describe: a place on the neighbouring primitive, or on another side of this one.

    Args:
        links: Link of each primitive, shape (P,).
        friction_ratio: That of the prior.
        buffers: With the measurement, and the known contacts after
            `contactsense.multi_contact.known_prior.fill_known_prior`; `seeding` is filled.
        known_count, change: Their number, and what has changed of them.
        force_scale: Approximate magnitude of the forces [N].
        m: Number of rows of the measurement.
    """
    rows, seeding, joint = buffers.rows, buffers.seeding, buffers.joint
    seeding.prior_covariance[:m, :m] = 0.0
    for r in range(m):
        seeding.prior_covariance[r, r] = 1.0
        seeding.innovation[r] = rows.value[r]
    deviations, is_held = force_deviations(force_scale, friction_ratio), change.drift < math.inf
    if is_held:
        deviations = (change.drift, change.drift)
        _subtract_known_wrenches(joint, known_count, m, seeding)
        if change.measured:
            deviations = (0.0, 0.0)
            _add_known_forces(joint, known_count, m, buffers.known_prior, seeding)
    for i in range(known_count):
        block, C, force_norm = joint.contact[i], buffers.known.covariance[i], force_scale
        c, n, f = vector_of(block, PX, 0), vector_of(block, NX, 0), vector_of(block, FX, 0)
        if is_held:
            force_norm = norm(f)
        _add_contact_covariance(
            rows,
            m,
            links[buffers.known.primitive[i]],
            (c[0], c[1], c[2], n[0], n[1], n[2]),
            deviations,
            force_norm * math.sqrt(0.5 * (C[0, 0] + C[1, 1] + C[2, 2])),
            seeding.force_jacobian,
            seeding.weighted_innovation,
            seeding.prior_covariance,
        )


@fused_kernel
def _subtract_known_wrenches(joint: JointState, known_count: int, m: int, seeding: SeedingBuffers) -> None:
    """The innovation over the wrenches of the known contacts, which are in lane 0."""
    for r in range(m):
        for i in range(known_count):
            for k in range(6):
                seeding.innovation[r] -= joint.rows[i, (6 * r + k) * LANES] * joint.contact[i, W0 + k * LANES]


@fused_kernel
def _add_known_forces(
    joint: JointState, known_count: int, m: int, known_prior: KnownPriorScratch, seeding: SeedingBuffers
) -> None:
    """Covariance of the rows due to what is not known of forces, torsions and offsets of the known contacts,
    which are in lane 0, given their places.

    With the derivative J of the rows by these unknowns and the factor U of the information on them, the
    covariance is (J U^-1) (J U^-1)^T.
    """
    U, Y, first, size = known_prior.factor, known_prior.whitened, PLACES * known_count, UNKNOWNS * known_count
    for r in range(m):
        y = Y[r]
        for a in range(size - 1, first - 1, -1):
            x = joint.jacobian[unknown_of_factor(a, known_count), r * LANES]
            for b in range(a + 1, size):
                x -= U[b, a] * y[b]
            y[a] = x / U[a, a]
        for s in range(r + 1):
            for a in range(first, size):
                seeding.prior_covariance[r, s] += y[a] * Y[s, a]


@fused_kernel
def _add_contact_covariance(
    rows: MeasurementRows,
    m: int,
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
        rows, m, link: The measurement, the number of its rows, the touched link.
        point_normal: Point and outward normal, base frame, six floats.
        deviations: Standard deviations of the force along the normal and along the tangents [N].
        moment_deviation: Standard deviation of each component of an additional moment [Nm].
        force_jacobian: Scratch: derivative of each row by the force, shape (M, 3).
        normal_jacobian: Filled: derivative of each row by a force along the normal, shape (M,).
        out: Shape (M, M).
    """
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
def add_sample_covariance(
    seed_samples: SeedSamples,
    friction_ratio: float,
    i: int,
    force_scale: float,
    rows: MeasurementRows,
    m: int,
    seeding: SeedingBuffers,
    out: np.ndarray,
) -> None:
    """`_add_contact_covariance` for a contact at sample i."""
    c = seeding.point_normal[i]
    point_normal = (c[0], c[1], c[2], c[3], c[4], c[5])
    moment_deviation = seed_samples.spread[seed_samples.link[i]] * force_scale
    deviations = force_deviations(force_scale, friction_ratio)
    _add_contact_covariance(
        rows,
        m,
        seed_samples.link[i],
        point_normal,
        deviations,
        moment_deviation,
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
def initial_forces(
    seed_samples: SeedSamples,
    friction_ratio: float,
    s: int,
    count: int,
    force_scale: float,
    rows: MeasurementRows,
    m: int,
    seeding: SeedingBuffers,
    out: np.ndarray,
) -> None:
    """Most likely forces at the samples of a seed, base axes, shape (>= count, 3) [N]."""
    copy_lower(m, seeding.prior_covariance, seeding.factor)
    for e in range(count):
        add_sample_covariance(
            seed_samples,
            friction_ratio,
            seeding.seed[s, e],
            force_scale,
            rows,
            m,
            seeding,
            seeding.factor,
        )
    log_likelihood(m, seeding)
    weight_innovation(m, seeding)
    tangential_variance = (RATIO_FACTOR * friction_ratio * force_scale) ** 2
    for e in range(count):
        i = seeding.seed[s, e]
        link = seed_samples.link[i]
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
