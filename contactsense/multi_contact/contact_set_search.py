"""Search over sets of one, two or three contacts, with or without contacts that are tracked already.

For every number of contacts, the joint optimization starts from each seed. The results compete by log
evidence, with a prior for each further contact, so that a second contact is reported only if one contact
does not explain the measurement.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.localization.problem.searched_surface import placed_surface
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.multi_contact.explanations.pooled_evidence import PooledSets, log_of_sum, pool_link_evidence
from contactsense.multi_contact.explanations.pooled_places import pool_places, widen_places
from contactsense.multi_contact.explanations.ranked_sets import rank_sets, share_evidence
from contactsense.multi_contact.explanations.set_evidence import (
    add_accessibility,
    fill_set_evidence,
    known_evidence,
)
from contactsense.multi_contact.explanations.stored_explanations import mix_with_candidate, store_explanation
from contactsense.multi_contact.explanations.summed_pairs import store_summed_pairs
from contactsense.multi_contact.further_contact import (
    SingleContactSearch,
    is_any_broad,
    locate_further_contact,
)
from contactsense.multi_contact.joint.contact_step import move_to_cells
from contactsense.multi_contact.joint.initial_contacts import (
    initialize_from_seed,
    initialize_further_contact,
    initialize_known_contact,
)
from contactsense.multi_contact.joint.joint_covariance import fill_covariances
from contactsense.multi_contact.joint.joint_problem import JointProblem
from contactsense.multi_contact.joint.known_rows import Known
from contactsense.multi_contact.known_contacts.known_force_weights import weigh_by_known_forces
from contactsense.multi_contact.known_contacts.known_place_mixture import divide_known_places
from contactsense.multi_contact.known_contacts.known_prior import fill_known_prior
from contactsense.multi_contact.likelihood.sample_likelihood import SampleModel
from contactsense.multi_contact.memory.buffers import (
    MAX_SEEDS,
    MultiContactBuffers,
)
from contactsense.multi_contact.memory.joint_layout import ENERGY, LOG_EVIDENCE, TORSION
from contactsense.multi_contact.seeding.seed_search import drop_seeds_at_candidates, find_seeds
from contactsense.multi_contact.seeding.seeding_prior import initialize_seeding
from contactsense.robots.jit.kernel import fused_kernel, inlined_fused_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.solvers.posterior.contact_prior import Prior

MIN_ENERGY = 8.0
"""Further contacts are searched only if the lowest energy so far exceeds this."""
ENERGY_MARGIN = 30.0
"""Energy above the lowest so far at which an optimization is rejected.

More than the energies of explanations may differ, because the energy falls during the optimization.
"""


class Sought(NamedTuple):
    """What is searched for."""

    known: Known
    """What is known before."""
    contacts: int
    """Maximum number of contacts in a set, known ones included."""


class Starts(NamedTuple):
    """Starts of the joint search for some further contacts."""

    candidates: int
    """Number of candidates of the search for one contact; the known contacts alone count as one."""
    seeds: int
    """Number of sets of samples."""
    is_broad: bool
    """Whether the place of a candidate is uncertain: the explanations then take the probabilities of the
    candidates, and places are mixtures of both."""
    is_pooled: bool
    """Whether the explanations are pooled with the sums over samples."""


@fused_kernel
def search_contact_sets(
    single: SingleContactSearch, model: SampleModel, sought: Sought, buffers: MultiContactBuffers
) -> int:
    """Explain a measurement by the known contacts and further ones.

    Args:
        single: The search for one contact, with `buffers.candidates`, and with the body frames of the
            primitives filled.
        model: The samples and the measurement.
        sought: What is searched for.
        buffers: With all samples in the base frame in `seeding.point_normal`, and `known` filled. On return
            `explanations` is filled; in each set the known contacts come first.

    Returns:
        Number of ranked explanations.
    """
    known = sought.known
    measurement, joint, explanations = model.measurement, buffers.joint, buffers.explanations
    scene, prior = single.problem.scene, single.problem.prior
    surfaces, surface = scene.surfaces, placed_surface(scene, single.arrays)
    known_rows = fill_known_prior(
        surface, prior, measurement, buffers.known, known, joint, buffers.known_prior
    )
    if known.contacts < sought.contacts:
        initialize_seeding(surfaces.link, model, buffers, known)
    known_alone = known_evidence(
        JointProblem(surfaces, prior, measurement, known_rows, known.contacts), joint
    )
    stored = 0
    best, unlisted = math.inf, -math.inf
    for further in range(0 if known.contacts > 0 else 1, sought.contacts - known.contacts + 1):
        if best < MIN_ENERGY:
            break
        starts = _find_starts(single, model, sought, further, buffers)
        count, first = known.contacts + further, stored
        problem = JointProblem(surfaces, prior, measurement, known_rows, count)
        stored, lowest_energy = _search_from(
            starts, surface, problem, model, known, known_alone, first, buffers
        )
        if starts.is_pooled:
            sets = PooledSets(explanations, first, stored, known.contacts, further)
            stored = _pool(surface, prior, model, sets, buffers)
            unlisted = log_of_sum(buffers.seeding.pair_evidence, explanations.score, 0)
        elif starts.is_broad:
            share_evidence(surfaces.link, explanations, first, stored, 2.0 * prior.surface_deviation)
        best = min(best, lowest_energy)
    # In a stream the forces of known contacts hardly change between samples: a longer search where they are
    # free gains nothing.
    if known.measured and known.contacts > 0:
        divide_known_places(surface, prior, buffers, measurement, known, stored)
    ranked: int = rank_sets(surfaces.link, explanations, stored, unlisted, 2.0 * prior.surface_deviation)
    return ranked


@inlined_fused_kernel
def _find_starts(
    single: SingleContactSearch,
    model: SampleModel,
    sought: Sought,
    further: int,
    buffers: MultiContactBuffers,
) -> Starts:
    """Where the joint search for that many further contacts starts: `buffers.candidates` are filled, and the
    seeds of `buffers.seeding`. Arguments as for `search_contact_sets`."""
    seeding, candidates, known = buffers.seeding, buffers.candidates, sought.known
    # The known contacts alone have a single start, two or more further ones start at samples.
    found, seeds = 1 if further == 0 else 0, 0
    is_broad, is_pooled = False, further == 2
    if further == 1:
        found = min(locate_further_contact(single, model.measurement, known.contacts, seeding), MAX_SEEDS)
        if known.contacts > 0 and known.drift == math.inf:
            links = single.problem.scene.surfaces.link
            weigh_by_known_forces(links, model, known.contacts, candidates, found, seeding)
        is_broad = found > 0 and is_any_broad(candidates, found)
        # The search for one contact takes free forces for normally distributed, so that they may pull: with
        # two of them the places that it finds are no reliable starts.
        is_pooled = is_broad and known.measured and known.contacts > 1 and known.drift == math.inf
    if is_pooled or further > 1:
        seeds = find_seeds(model, further, seeding)
    if further == 1:
        seeds = drop_seeds_at_candidates(model.samples.primitive, candidates, found, seeding, seeds)
    return Starts(found, seeds, is_broad, is_pooled)


@inlined_fused_kernel
def _search_from(
    starts: Starts,
    surface: PlacedSurface,
    problem: JointProblem,
    model: SampleModel,
    known: Known,
    known_alone: float,
    stored: int,
    buffers: MultiContactBuffers,
) -> tuple[int, float]:
    """Search jointly from all starts, in blocks of lanes, and store the explanations that are found.

    Args:
        starts: The starts.
        surface: Where contacts may be.
        problem: The measurement with the known contacts and the further ones that are sought.
        model: The samples and the measurement.
        known: The number of known contacts, and what has changed since they were estimated.
        known_alone: Log evidence of the known contacts alone.
        stored: Number of explanations before.
        buffers: As in `search_contact_sets`.

    Returns:
        Number of explanations, and the lowest energy of a new one.
    """
    joint, explanations, candidates = buffers.joint, buffers.explanations, buffers.candidates
    prior, count = problem.prior, problem.contacts
    lowest_energy = math.inf
    total = starts.candidates + starts.seeds
    for start in range(0, total, LANES):
        lanes = min(LANES, total - start)
        for j in range(lanes):
            _initialize(surface, problem, model, known, buffers, starts.candidates, start + j, j)
        limit = lowest_energy + ENERGY_MARGIN
        fill_set_evidence(problem, lanes, limit, joint)
        if surface.deviations.largest_displacement > 0.0 and move_to_cells(
            surface, prior, known.contacts, count, lanes, joint
        ):
            fill_set_evidence(problem, lanes, limit, joint)
        add_accessibility(surface, prior, known.contacts, count, lanes, joint)
        fill_covariances(count, joint)
        for j in range(lanes):
            if joint.lane[LOG_EVIDENCE, j] > -math.inf:
                lowest_energy = min(lowest_energy, joint.lane[ENERGY, j])
        for j in range(lanes):
            is_found = joint.lane[LOG_EVIDENCE, j] > -math.inf
            if not is_found or joint.lane[ENERGY, j] > lowest_energy + ENERGY_MARGIN:
                continue
            store_explanation(joint, j, count, known_alone, explanations, stored)
            if starts.is_broad and start + j < starts.candidates:
                row = candidates.order[start + j]
                mix_with_candidate(candidates, row, known.contacts, explanations, stored)
            stored += 1
    return stored, lowest_energy


@inlined_fused_kernel
def _pool(
    surface: PlacedSurface,
    prior: Prior,
    model: SampleModel,
    sets: PooledSets,
    buffers: MultiContactBuffers,
) -> int:
    """Pool the explanations found last with the sums over samples; returns the number of explanations."""
    seeding, link, deviation = buffers.seeding, surface.surfaces.link, prior.surface_deviation
    if sets.further == 1:
        _fill_link_evidence(seeding.link_probability, seeding.pair_evidence)
    else:
        _add_link_prior(prior.log_link_density, seeding.pair_evidence)
    pool_link_evidence(link, sets, seeding.pair_evidence, deviation)
    if sets.further == 2 and sets.known == 0:
        pool_places(link, model.samples, deviation, seeding, sets)
        stored: int = store_summed_pairs(model, deviation, seeding, sets.explanations, sets.last)
        return stored
    widen_places(sets, deviation)
    return sets.last


@fused_kernel
def _initialize(
    surface: PlacedSurface,
    problem: JointProblem,
    model: SampleModel,
    known: Known,
    buffers: MultiContactBuffers,
    candidates_used: int,
    s: int,
    lane: int,
) -> None:
    """Initialize a lane with start s: one of the candidates used, or behind them a seed."""
    prior, further = problem.prior, problem.contacts - known.contacts
    candidates, joint = buffers.candidates, buffers.joint
    for i in range(known.contacts):
        initialize_known_contact(surface, prior, buffers.known, joint, known, model.force_scale, lane, i)
    if s >= candidates_used:
        initialize_from_seed(
            surface, prior, model, buffers, (known.contacts, further), lane, s - candidates_used
        )
    elif further == 1:
        row = candidates.order[s]
        initialize_further_contact(
            surface, prior, joint, candidates.primitive[row], candidates.point[row], candidates.force[row],
            lane, known.contacts,
        )  # fmt: skip
        joint.contact[known.contacts, TORSION + lane] = candidates.torsion[row]


@fused_kernel
def _fill_link_evidence(probability: np.ndarray, out: np.ndarray) -> None:
    """Log probability of each link in the diagonal of `out`, shape (links, links); -infinity elsewhere."""
    out[:] = -math.inf
    for link in range(probability.shape[0]):
        if probability[link] > 0.0:
            out[link, link] = math.log(probability[link])


@fused_kernel
def _add_link_prior(log_link_density: np.ndarray, out: np.ndarray) -> None:
    """Add the prior over links to the log evidence of pairs of links, which is that of places uniform by
    area; shape (links, links), k >= l in row k."""
    for k in range(out.shape[0]):
        for link in range(k + 1):
            out[k, link] += log_link_density[k] + log_link_density[link]
