"""What is known of the rows before a further contact is searched: their covariance due to noise and known
contacts, and the innovation over the forces of these."""

import math

import numpy as np

from contactsense.multi_contact.joint.contact_step import vector_of
from contactsense.multi_contact.joint.known_rows import Known, unknown_of_factor
from contactsense.multi_contact.likelihood.sample_likelihood import (
    SampleModel,
    add_contact_covariance,
    force_deviations,
)
from contactsense.multi_contact.memory.buffers import (
    PLACES,
    UNKNOWNS,
    JointState,
    KnownPriorScratch,
    Measurement,
    MultiContactBuffers,
    SeedingBuffers,
)
from contactsense.multi_contact.memory.joint_layout import FX, NX, PX, W0
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.vectors import Vector, dot, norm, tangents, vector
from contactsense.sensors.usable_sensors import Usable

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
def initialize_seeding(
    links: np.ndarray, model: SampleModel, buffers: MultiContactBuffers, known: Known
) -> None:
    """Covariance of the rows due to noise and known contacts, and the innovation over their known forces.

    The places of known contacts are taken for independent of their forces, and the moment that they leave
    open for the same about all axes. That is more than the covariances of a normal distribution, and allows
    for what it does not describe: a place on the neighbouring primitive, or on another side of this one. A
    force that may have become another one is of the size that it had, or of what the sensors measure if that
    is more.

    Args:
        links: Link of each primitive, shape (P,).
        model: The samples and the measurement.
        buffers: With the known contacts after
            `contactsense.multi_contact.known_contacts.known_prior.fill_known_prior`; `seeding` is filled.
        known: Their number, less than `contactsense.multi_contact.memory.buffers.MAX_CONTACTS`, and what has
            changed of them.
    """
    (rows, m), force_scale = model.measurement, model.force_scale
    seeding, joint = buffers.seeding, buffers.joint
    seeding.prior_covariance[:m, :m] = 0.0
    for r in range(m):
        seeding.prior_covariance[r, r] = 1.0
        seeding.innovation[r] = rows.value[r]
    is_held = known.drift < math.inf
    deviations = (known.drift, known.drift)
    if is_held:
        _subtract_known_wrenches(joint, known.contacts, m, seeding)
        if known.measured:
            deviations = (0.0, 0.0)
            _add_known_forces(joint, known.contacts, m, buffers.known_prior, seeding)
    for i in range(known.contacts):
        block, C = joint.contact[i], buffers.known.covariance[i]
        c, n, f = vector_of(block, PX, 0), vector_of(block, NX, 0), vector_of(block, FX, 0)
        force_norm = norm(f)
        if not is_held:
            # Forces that balance each other are larger than what the sensors measure of them.
            force_norm = max(force_scale, norm(vector(buffers.known.force[i])))
            deviations = force_deviations(force_norm, model.friction_ratio)
        add_contact_covariance(
            model.measurement,
            links[buffers.known.primitive[i]],
            (c[0], c[1], c[2], n[0], n[1], n[2]),
            deviations,
            force_norm * math.sqrt(0.5 * (C[0, 0] + C[1, 1] + C[2, 2])),
            seeding.force_jacobian,
            seeding.weighted_innovation,
            seeding.prior_covariance,
        )
        if not is_held:
            _fill_known_jacobian(
                model.measurement, links[buffers.known.primitive[i]], n, deviations, i, seeding
            )


@fused_kernel
def _fill_known_jacobian(
    measurement: Measurement,
    link: int,
    normal: Vector,
    deviations: tuple[float, float],
    i: int,
    seeding: SeedingBuffers,
) -> None:
    """Fill the columns of known contact i in `seeding.known_jacobian`, after `add_contact_covariance`."""
    rows, m = measurement
    first, second = tangents(normal)
    for r in range(m):
        # Rows that do not see this link have kept the derivative of another contact.
        seen, b = rows.seen[link, r], vector(seeding.force_jacobian[r])
        out = seeding.known_jacobian[r, 3 * i :]
        out[0] = seen * deviations[0] * dot(b, normal)
        out[1] = seen * deviations[1] * dot(b, first)
        out[2] = seen * deviations[1] * dot(b, second)


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
