"""Search over sets of one, two or three contacts, with or without contacts that are tracked already.

For every number of contacts, the joint optimization starts from each seed. The results compete by log
evidence, with a prior for each further contact, so that a second contact is reported only if one contact
does not explain the measurement.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.kinematics.model import Motion
from contactsense.localization.accessibility import accessible_share, clearance, is_mounting_face
from contactsense.localization.searched_surface import SearchArrays, SearchedSurface
from contactsense.multi_contact.buffers import (
    MAX_SEEDS,
    KnownContacts,
    MeasurementRows,
    MultiContactBuffers,
    OptimizerState,
    PrimitiveFrames,
)
from contactsense.multi_contact.further_contact import is_any_broad, locate_further_contact
from contactsense.multi_contact.joint_optimization import find_joint_mode, set_contact
from contactsense.multi_contact.pooled_evidence import pool_link_evidence
from contactsense.multi_contact.ranked_sets import (
    adopt_candidate,
    rank_sets,
    share_evidence,
    store_explanation,
)
from contactsense.multi_contact.sample_likelihood import initial_forces, initialize_seeding
from contactsense.multi_contact.seeding import find_seeds
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.solvers.posterior import STUDENT_DOF, Prior, pushing_force

FURTHER_CONTACT_ODDS = 0.02
"""Prior odds of one more contact."""
MIN_ENERGY = 8.0
"""Further contacts are searched only if the lowest energy so far exceeds this."""
ENERGY_MARGIN = 30.0
"""Energy above the lowest so far at which an optimization is rejected.

More than the energies of explanations may differ, because the energy falls during the optimization.
"""
MIN_POINT_DEVIATION = 1e-4
"""Lower bound of the standard deviation of a known point [m]."""


class Sought(NamedTuple):
    """What is searched for."""

    known: int
    """Number of known contacts."""
    contacts: int
    """Maximum number of contacts in a set, known ones included."""
    at_rest: bool
    """Whether the measurement is a single one, of an arm at rest.

    In a stream the forces of known contacts hardly change between samples, so that a longer search where they
    are free gains nothing."""


@fused_kernel
def search_contact_sets(
    scene: SearchedSurface,
    motion: Motion,
    wrench_measured: bool,
    prior: Prior,
    arrays: SearchArrays,
    buffers: MultiContactBuffers,
    m: int,
    force_scale: float,
    sought: Sought,
) -> int:
    """Explain a measurement by the known contacts and further ones.

    Args:
        scene, motion, wrench_measured, prior, arrays: As for
            `contactsense.localization.ranking.locate_contacts`, with `buffers.candidates`, in which the body
            frames of the primitives are filled.
        buffers: With the measurement in `rows`, all samples in the base frame in `seeding.point_normal`,
            and `known` filled. On return `explanations` is filled; in each set the known contacts come
            first.
        m: Number of rows.
        force_scale: Approximate magnitude of the forces [N].
        sought: What is searched for.

    Returns:
        Number of ranked explanations.
    """
    known_count, max_contacts, at_rest = sought
    seed_samples, rows, known_contacts, optimizer, seeding, candidates, explanations = buffers
    surfaces, frames = scene.surfaces, PrimitiveFrames(candidates.rotation, candidates.origin)
    for i in range(known_count):
        initialize_known_contact(
            surfaces, frames, known_contacts, optimizer, seeding.known_normal[i], force_scale, i
        )
    initialize_seeding(
        surfaces.link, prior.friction_ratio, known_contacts, known_count, force_scale, rows, m, seeding
    )
    prior_log_evidence = known_evidence(surfaces, prior, frames, rows, known_count, optimizer)
    stored = 0
    best = math.inf
    unlisted = -math.inf
    for further in range(0 if known_count > 0 else 1, max_contacts - known_count + 1):
        if best < MIN_ENERGY:
            break
        # The known contacts alone have a single start.
        candidates_used, samples_used = 1, 0
        is_broad, is_pooled = False, further == 2
        if further == 1:
            candidates_used = min(
                locate_further_contact(scene, motion, wrench_measured, prior, arrays, rows, m, seeding),
                MAX_SEEDS,
            )
            is_broad = candidates_used > 0 and is_any_broad(candidates, candidates_used)
            is_pooled = is_broad and at_rest and _are_many_forces_free(known_contacts, known_count)
        elif further > 1:
            candidates_used = 0
        if is_pooled or further > 1:
            samples_used = find_seeds(
                seed_samples, prior.friction_ratio, further, force_scale, rows, m, seeding
            )
        lowest_energy = math.inf
        first = stored
        for s in range(candidates_used + samples_used):
            for i in range(known_count):
                initialize_known_contact(
                    surfaces, frames, known_contacts, optimizer, seeding.known_normal[i], force_scale, i
                )
            # The candidates come first, then the samples, which have no row.
            row = candidates.order[s] if s < candidates_used else -1
            if row < 0:
                _initialize_from_seed(
                    surfaces,
                    prior,
                    frames,
                    buffers,
                    m,
                    force_scale,
                    known_count,
                    further,
                    s - candidates_used,
                )
            elif further == 1:
                _initialize_further_contact(
                    surfaces,
                    frames,
                    optimizer,
                    candidates.primitive[row],
                    candidates.point[row],
                    candidates.force[row],
                    known_count,
                )
                optimizer.torsion[known_count] = candidates.torsion[row]
            count = known_count + further
            energy, score = set_evidence(
                surfaces, prior, frames, rows, m, known_count, count, lowest_energy + ENERGY_MARGIN, optimizer
            )
            if score > -math.inf:
                store_explanation(
                    optimizer,
                    prior.surface_deviation,
                    count,
                    energy,
                    score - prior_log_evidence,
                    explanations,
                    stored,
                )
                if is_broad and row >= 0:
                    adopt_candidate(candidates, row, known_count, explanations, stored)
                stored += 1
                lowest_energy = min(lowest_energy, energy)
        if is_pooled:
            if further == 1:
                _fill_link_evidence(seeding.link_probability, seeding.pair_evidence)
            unlisted = pool_link_evidence(
                surfaces.link,
                explanations,
                first,
                stored,
                known_count,
                further,
                seeding.pair_evidence,
                prior.surface_deviation,
            )
        elif is_broad:
            share_evidence(explanations, first, stored)
        best = min(best, lowest_energy)
    ranked: int = rank_sets(surfaces.link, explanations, stored, unlisted, 2.0 * prior.surface_deviation)
    return ranked


@fused_kernel
def _are_many_forces_free(known_contacts: KnownContacts, count: int) -> bool:
    """Whether two or more contacts are known, but not their forces.

    The search for one contact takes these forces for normally distributed, so that they may pull; with two of
    them its candidates are no reliable seeds, and their probabilities not those of the places.
    """
    free = 0
    for i in range(count):
        free += 1 if known_contacts.drift[i] == math.inf else 0
    return free > 1


@fused_kernel
def _fill_link_evidence(probability: np.ndarray, out: np.ndarray) -> None:
    """Log probability of each link in the diagonal of `out`, shape (links, links); -infinity elsewhere."""
    out[:] = -math.inf
    for link in range(probability.shape[0]):
        if probability[link] > 0.0:
            out[link, link] = math.log(probability[link])


@fused_kernel
def known_evidence(
    surfaces: Surfaces,
    prior: Prior,
    frames: PrimitiveFrames,
    rows: MeasurementRows,
    known_count: int,
    optimizer: OptimizerState,
) -> float:
    """Log evidence of the known contacts before the measurement.

    The optimization uses the same priors for every contact: of its link and place, and of its force.
    The priors of known contacts are additional factors exp(-d^2 / 2) and not normalized. Subtracting this
    log evidence normalizes them, so that explanations with different known contacts are comparable.
    """
    if known_count == 0:
        return 0.0
    _, score = find_joint_mode(surfaces, frames, rows, 0, prior, known_count, math.inf, optimizer)
    if score == -math.inf:
        return 0.0
    for i in range(known_count):
        if optimizer.prior_force_information[i] == 0.0:
            # Without a prior of the force, correct Laplace's approximation for the tail of Student's t.
            score += math.log(1.0 + 2.0 / STUDENT_DOF)
    return float(score)


@fused_kernel
def set_evidence(
    surfaces: Surfaces,
    prior: Prior,
    frames: PrimitiveFrames,
    rows: MeasurementRows,
    m: int,
    known_count: int,
    count: int,
    limit: float,
    optimizer: OptimizerState,
) -> tuple[float, float]:
    """Optimize the contacts in `optimizer`, the known ones first.

    Arguments as for `contactsense.multi_contact.joint_optimization.find_joint_mode`.

    Returns:
        Energy, and log evidence with the priors of the further contacts.
    """
    energy, score = find_joint_mode(surfaces, frames, rows, m, prior, count, limit, optimizer)
    if energy < math.inf:
        score += (count - known_count) * math.log(FURTHER_CONTACT_ODDS)
        score += _log_accessibility(surfaces, frames, prior, optimizer, known_count, count)
    return energy, score


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
def _initialize_further_contact(
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
def _initialize_from_seed(
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
        _initialize_further_contact(
            surfaces,
            frames,
            buffers.optimizer,
            seed_samples.primitive[i],
            seeding.point_normal[i],
            seeding.initial_force[e],
            known_count + e,
        )


@fused_kernel
def _log_accessibility(
    surfaces: Surfaces,
    frames: PrimitiveFrames,
    prior: Prior,
    optimizer: OptimizerState,
    known_count: int,
    count: int,
) -> float:
    """Log of the accessible share of the further contacts."""
    score = 0.0
    for i in range(known_count, count):
        c, p, T = optimizer.point[i], optimizer.primitive[i], optimizer.frame[i]
        if is_mounting_face(surfaces.link[p], c[2], T[2, 0], prior.surface_deviation):
            return -math.inf
        height = prior.clearance
        x, y, z = c[0] + height * T[0, 0], c[1] + height * T[1, 0], c[2] + height * T[2, 0]
        score += math.log(accessible_share(clearance(surfaces, frames, p, x, y, z, 0.0), prior))
    return score
