"""Where the joint optimization of a set of contacts starts: known contacts, and further ones at candidates or
at samples of the surface."""

import math

import numpy as np

from contactsense.multi_contact.buffers import (
    KnownContacts,
    MultiContactBuffers,
    OptimizerState,
    PrimitiveFrames,
)
from contactsense.multi_contact.joint_optimization import set_contact
from contactsense.multi_contact.sample_likelihood import initial_forces
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.solvers.posterior import Prior, pushing_force

MIN_POINT_DEVIATION = 1e-4
"""Lower bound of the standard deviation of a known point [m]."""


@fused_kernel
def initialize_known_contact(
    surfaces: Surfaces,
    frames: PrimitiveFrames,
    known_contacts: KnownContacts,
    optimizer: OptimizerState,
    normal: np.ndarray,
    force_scale: float,
    i: int,
) -> None:
    """Initialize contact i with known contact i: point, force and their priors.

    Without a prior of the force, the initial force is a push of the given scale [N]. `normal` is filled
    with the outward normal.
    """
    c, f = known_contacts.point[i], known_contacts.force[i]
    point, force = (c[0], c[1], c[2]), (f[0], f[1], f[2])
    set_contact(surfaces, frames, optimizer, i, known_contacts.primitive[i], point, force)
    normal[0], normal[1], normal[2] = (
        optimizer.frame[i, 0, 0],
        optimizer.frame[i, 1, 0],
        optimizer.frame[i, 2, 0],
    )
    fx, fy, fz = f[0], f[1], f[2]
    optimizer.prior_force_information[i] = 0.0
    if known_contacts.drift[i] < math.inf:
        optimizer.prior_force_information[i] = 1.0 / known_contacts.drift[i] ** 2
    else:
        fx, fy, fz = -force_scale * normal[0], -force_scale * normal[1], -force_scale * normal[2]
    for k in range(3):
        optimizer.prior_point[i, k] = optimizer.point[i, k]
        optimizer.prior_force[i, k] = f[k]
    optimizer.force[i, 0], optimizer.force[i, 1], optimizer.force[i, 2] = pushing_force(
        (fx, fy, fz), (normal[0], normal[1], normal[2])
    )
    _point_information(optimizer.frame[i], known_contacts.covariance[i], optimizer.prior_point_information[i])


@fused_kernel
def _point_information(T: np.ndarray, C: np.ndarray, out: np.ndarray) -> None:
    """Information matrix of a point: inverse of its covariance C in the tangent plane of the frame T."""
    aa, ab, bb = MIN_POINT_DEVIATION * MIN_POINT_DEVIATION, 0.0, MIN_POINT_DEVIATION * MIN_POINT_DEVIATION
    for i in range(3):
        for k in range(3):
            aa += T[i, 1] * C[i, k] * T[k, 1]
            ab += T[i, 1] * C[i, k] * T[k, 2]
            bb += T[i, 2] * C[i, k] * T[k, 2]
    det = aa * bb - ab * ab
    for i in range(3):
        for k in range(3):
            out[i, k] = (
                bb * T[i, 1] * T[k, 1] - ab * (T[i, 1] * T[k, 2] + T[i, 2] * T[k, 1]) + aa * T[i, 2] * T[k, 2]
            ) / det


@fused_kernel
def initialize_further_contact(
    surfaces: Surfaces,
    frames: PrimitiveFrames,
    optimizer: OptimizerState,
    primitive: int,
    point: np.ndarray,
    force: np.ndarray,
    i: int,
) -> None:
    """Initialize contact i near a point [m] on a primitive, with the given force [N], base frame."""
    c = (point[0], point[1], point[2])
    set_contact(surfaces, frames, optimizer, i, primitive, c, (0.0, 0.0, 0.0))
    T = optimizer.frame[i]
    optimizer.force[i, 0], optimizer.force[i, 1], optimizer.force[i, 2] = pushing_force(
        (force[0], force[1], force[2]), (T[0, 0], T[1, 0], T[2, 0])
    )
    optimizer.prior_point_information[i] = 0.0
    optimizer.prior_force_information[i] = 0.0


@fused_kernel
def initialize_from_seed(
    surfaces: Surfaces,
    prior: Prior,
    frames: PrimitiveFrames,
    buffers: MultiContactBuffers,
    m: int,
    force_scale: float,
    known_count: int,
    further: int,
    s: int,
) -> None:
    """Initialize the further contacts at the samples of seed s, with their most likely forces."""
    seed_samples, seeding = buffers.seed_samples, buffers.seeding
    initial_forces(
        seed_samples,
        prior.friction_ratio,
        s,
        further,
        force_scale,
        buffers.rows,
        m,
        seeding,
        seeding.initial_force,
    )
    for e in range(further):
        i = seeding.seed[s, e]
        initialize_further_contact(
            surfaces,
            frames,
            buffers.optimizer,
            seed_samples.primitive[i],
            seeding.point_normal[i],
            seeding.initial_force[e],
            known_count + e,
        )
