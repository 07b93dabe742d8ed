"""Search over sets of one, two or three contacts, with or without contacts that are tracked already.

For every number of contacts, the joint optimization starts from each seed. The results compete by log
evidence, with a prior for each further contact, so that a second contact is reported only if one contact
does not explain the measurement.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.kinematics.model import Motion
from contactsense.localization.searched_surface import SearchArrays, SearchedSurface
from contactsense.multi_contact.buffers import (
    MAX_SEEDS,
    MultiContactBuffers,
    PlacedSurface,
)
from contactsense.multi_contact.contact_step import move_to_cells
from contactsense.multi_contact.further_contact import is_any_broad, locate_further_contact
from contactsense.multi_contact.initial_contacts import (
    initialize_from_seed,
    initialize_further_contact,
    initialize_known_contact,
)
from contactsense.multi_contact.joint_covariance import fill_covariances
from contactsense.multi_contact.joint_layout import ENERGY, LOG_EVIDENCE, TORSION
from contactsense.multi_contact.known_place_mixture import divide_known_places
from contactsense.multi_contact.known_prior import fill_known_prior
from contactsense.multi_contact.known_rows import Change
from contactsense.multi_contact.pooled_evidence import log_of_sum, pool_link_evidence
from contactsense.multi_contact.pooled_places import pool_places, widen_places
from contactsense.multi_contact.ranked_sets import (
    adopt_candidate,
    rank_sets,
    share_evidence,
    store_explanation,
)
from contactsense.multi_contact.sample_likelihood import initialize_seeding
from contactsense.multi_contact.seeding import drop_seeds_at_candidates, find_seeds
from contactsense.multi_contact.set_evidence import add_accessibility, fill_set_evidence, known_evidence
from contactsense.multi_contact.summed_pairs import store_summed_pairs
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.solvers.posterior import Prior

MIN_ENERGY = 8.0
"""Further contacts are searched only if the lowest energy so far exceeds this."""
ENERGY_MARGIN = 30.0
"""Energy above the lowest so far at which an optimization is rejected.

More than the energies of explanations may differ, because the energy falls during the optimization.
"""


class Sought(NamedTuple):
    """What is searched for."""

    known: int
    """Number of known contacts."""
    drift: float
    """Standard deviation of the change of each component of their forces [N]; infinity: these are new."""
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
    known_count, drift, max_contacts, at_rest = sought
    seed_samples, rows, joint, seeding = buffers.seed_samples, buffers.rows, buffers.joint, buffers.seeding
    candidates, explanations = buffers.candidates, buffers.explanations
    surfaces, surface = scene.surfaces, PlacedSurface(scene.surfaces, scene.deviations, candidates)
    change = Change(drift, at_rest)
    known = fill_known_prior(
        surface, prior, rows, m, buffers.known, known_count, change, joint,
        buffers.known_prior,
    )  # fmt: skip
    initialize_seeding(surfaces.link, prior.friction_ratio, buffers, known_count, change, force_scale, m)
    prior_log_evidence = known_evidence(surfaces, prior, rows, known, joint)
    stored = 0
    best = math.inf
    unlisted = -math.inf
    for further in range(0 if known_count > 0 else 1, max_contacts - known_count + 1):
        if best < MIN_ENERGY:
            break
        # The known contacts alone have a single start, two or more further ones start at samples.
        candidates_used, samples_used = 1 if further == 0 else 0, 0
        is_broad, is_pooled = False, further == 2
        if further == 1:
            candidates_used = min(
                locate_further_contact(
                    scene, motion, wrench_measured, prior, arrays, rows, m, known_count, seeding
                ),
                MAX_SEEDS,
            )
            is_broad = candidates_used > 0 and is_any_broad(candidates, candidates_used)
            # The search for one contact takes free forces for normally distributed, so that they may pull:
            # with two of them its candidates are no reliable seeds, and their probabilities not those of
            # the places.
            is_pooled = is_broad and at_rest and known_count > 1 and drift == math.inf
        if is_pooled or further > 1:
            samples_used = find_seeds(
                seed_samples, prior.friction_ratio, further, force_scale, rows, m, seeding
            )
        if further == 1:
            samples_used = drop_seeds_at_candidates(
                seed_samples.primitive, candidates, candidates_used, seeding, samples_used
            )
        lowest_energy = math.inf
        first = stored
        starts = candidates_used + samples_used
        for start in range(0, starts, LANES):
            lanes = min(LANES, starts - start)
            for j in range(lanes):
                _initialize(
                    surface, prior, buffers, m, change, force_scale,
                    (known_count, further, candidates_used), start + j, j,
                )  # fmt: skip
            count = known_count + further
            limit = lowest_energy + ENERGY_MARGIN
            fill_set_evidence(surfaces, prior, rows, m, known, count, lanes, limit, joint)
            if scene.deviations.mean_tilt > 0.0 and move_to_cells(
                surface, prior, known_count, count, lanes, joint
            ):
                fill_set_evidence(surfaces, prior, rows, m, known, count, lanes, limit, joint)
            add_accessibility(surface, prior, known_count, count, lanes, joint)
            fill_covariances(count, joint)
            for j in range(lanes):
                if joint.lane[LOG_EVIDENCE, j] > -math.inf:
                    lowest_energy = min(lowest_energy, joint.lane[ENERGY, j])
            for j in range(lanes):
                if not (
                    joint.lane[LOG_EVIDENCE, j] > -math.inf
                    and joint.lane[ENERGY, j] <= lowest_energy + ENERGY_MARGIN
                ):
                    continue
                store_explanation(joint, j, count, prior_log_evidence, explanations, stored)
                if is_broad and start + j < candidates_used:
                    adopt_candidate(
                        candidates, candidates.order[start + j], known_count, explanations, stored
                    )
                stored += 1
        if is_pooled:
            if further == 1:
                _fill_link_evidence(seeding.link_probability, seeding.pair_evidence)
            pool_link_evidence(
                surfaces.link,
                explanations,
                first,
                stored,
                known_count,
                further,
                seeding.pair_evidence,
                prior.surface_deviation,
            )
            if further == 2 and known_count == 0:
                pool_places(
                    surfaces.link, seed_samples, prior.surface_deviation, seeding, explanations, first, stored
                )
                stored = store_summed_pairs(
                    seed_samples, prior.friction_ratio, force_scale, prior.surface_deviation, rows, m,
                    seeding, explanations, stored,
                )  # fmt: skip
            else:
                widen_places(explanations, first, stored, known_count, further, prior.surface_deviation)
            unlisted = log_of_sum(seeding.pair_evidence, explanations.score, 0)
        elif is_broad:
            share_evidence(explanations, first, stored)
        best = min(best, lowest_energy)
    if at_rest and drift == math.inf and known_count > 0:
        divide_known_places(surface, prior, buffers, m, known, stored)
    ranked: int = rank_sets(surfaces.link, explanations, stored, unlisted, 2.0 * prior.surface_deviation)
    return ranked


@fused_kernel
def _initialize(
    surface: PlacedSurface,
    prior: Prior,
    buffers: MultiContactBuffers,
    m: int,
    change: Change,
    force_scale: float,
    counts: tuple[int, int, int],
    s: int,
    lane: int,
) -> None:
    """Initialize a lane with start s: a candidate, or behind them a seed.

    `counts`: numbers of known and of further contacts, and of candidates.
    """
    known_count, further, candidates_used = counts
    candidates, joint = buffers.candidates, buffers.joint
    for i in range(known_count):
        initialize_known_contact(surface, prior, buffers.known, joint, change, force_scale, lane, i)
    if s >= candidates_used:
        initialize_from_seed(
            surface, prior, buffers, m, force_scale, known_count, further, lane, s - candidates_used
        )
    elif further == 1:
        row = candidates.order[s]
        initialize_further_contact(
            surface, prior, joint, candidates.primitive[row], candidates.point[row], candidates.force[row],
            lane, known_count,
        )  # fmt: skip
        joint.contact[known_count, TORSION + lane] = candidates.torsion[row]


@fused_kernel
def _fill_link_evidence(probability: np.ndarray, out: np.ndarray) -> None:
    """Log probability of each link in the diagonal of `out`, shape (links, links); -infinity elsewhere."""
    out[:] = -math.inf
    for link in range(probability.shape[0]):
        if probability[link] > 0.0:
            out[link, link] = math.log(probability[link])
