"""Search for the contact if the line of action is known: one posterior mode on every primitive near the
line."""

import math

import numpy as np

from contactsense.isolation.link_hypotheses import Hypotheses
from contactsense.kinematics.wrench_information import to_body_frame
from contactsense.localization.candidates.accessibility import apply_accessibility, is_mounting_face
from contactsense.localization.candidates.candidate_buffers import Candidates, store_candidate
from contactsense.localization.problem.searched_surface import SearchArrays, placed_surface
from contactsense.localization.problem.single_contact_problem import SingleContactProblem
from contactsense.localization.surface.line_distance import (
    CENTRE_X,
    CENTRE_Y,
    CENTRE_Z,
    OFFSET,
    RADIUS,
    SHIFT_ENERGY,
    moment_variance,
    shift_energies,
    shift_energy,
)
from contactsense.localization.surface.local_prior import nearest_cell, prior_in_cell, surface_error_in_cell
from contactsense.localization.surface.mean_surface import entered_cell, mean_frame
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.localization.surface.primitive_frames import Frame
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.solvers.posterior.block import CX, CY, CZ, GAP, NX, NY, NZ, SEARCH, W0, W1, W2
from contactsense.solvers.posterior.contact_prior import Contact, Prior, pushing_force
from contactsense.solvers.posterior.line_of_action import enter_surfaces
from contactsense.solvers.posterior.mode import (
    CONVERGED,
    ENERGY_CUTOFF,
    ENERGY_TOLERANCE,
    IDLE,
    begin_search,
    find_posterior_modes,
    mode_of,
    resume_searches,
)
from contactsense.solvers.posterior.simd import (
    load_frame,
    load_primitive,
    load_prior,
    load_wrench,
    wrenches_to_body_frames,
)


@fused_kernel
def search_along_line_of_action(
    problem: SingleContactProblem, arrays: SearchArrays, competing_evidence: float, most_primitives: int
) -> int:
    """Find the most probable contact on each primitive near the line of action, conditioned on being
    accessible; row p is for primitive p.

    Args:
        problem: The measurement, and where the contact may be.
        arrays: With the body frames of the primitives; `candidates` is filled.
        competing_evidence: Log evidence of what else explains the measurement: primitives whose bound is
            hopeless beside it are not searched.
        most_primitives: Nothing is searched if the line may well enter more primitives than this.

    Returns:
        Number of rows in `order`; -1 if nothing is searched. The `score` of rejected rows is -infinity.
    """
    surface, searched = placed_surface(problem.scene, arrays), problem.searched
    hypotheses, prior = problem.hypotheses, problem.prior
    block, candidates = arrays.buffers.block, arrays.candidates
    lowest_bound = bound_energies(surface, searched, hypotheses, prior, candidates, most_primitives)
    if lowest_bound == -math.inf:
        return -1
    best = math.inf, -math.inf
    count, begun = 0, 0
    # First the primitives that the line may well enter: they set a limit that excludes most of the others.
    highest = ENERGY_CUTOFF - competing_evidence
    for limit in (min(lowest_bound + ENERGY_CUTOFF, highest), highest):
        for p in range(surface.surfaces.start[searched.shape[0]]):
            bound = candidates.bound[p]
            # Each primitive once: then its bound is infinite.
            if bound < math.inf and bound <= min(limit, best[0] + ENERGY_CUTOFF):
                candidates.bound[p] = math.inf
                candidates.order[count] = p
                count += 1
                if count - begun == LANES:
                    rows = candidates.order[begun:count]
                    best = _search_block(surface, rows, hypotheses, prior, block, candidates, best)
                    begun = count
        if count > begun:
            rows = candidates.order[begun:count]
            best = _search_block(surface, rows, hypotheses, prior, block, candidates, best)
            begun = count
    return count


@fused_kernel
def bound_energies(
    surface: PlacedSurface,
    searched: np.ndarray,
    hypotheses: Hypotheses,
    prior: Prior,
    candidates: Candidates,
    most_primitives: int,
) -> float:
    """Lower bounds of the energies on all primitives, by the spheres about them, written to `bound`.

    Args:
        surface: Where contacts may be.
        searched, hypotheses, prior: As in
            `contactsense.localization.problem.single_contact_problem.SingleContactProblem`.
        candidates: `bound` is filled, and `spheres` is scratch.
        most_primitives: As for `search_along_line_of_action`.

    Returns:
        The lowest one; -infinity, and not all are written, if more primitives than that have low ones.
    """
    lowest, spheres, surfaces = math.inf, candidates.spheres, surface.surfaces
    least_energy, best_link = math.inf, 0
    for link in range(searched.shape[0]):
        if searched[link] and hypotheses.energy[link] < least_energy:
            least_energy, best_link = hypotheses.energy[link], link
    near, links = 0, searched.shape[0]
    for k in range(links):
        # The best link first: its primitives are soon too many.
        link = (best_link + k) % links
        w, energy = hypotheses.wrench[link], hypotheses.energy[link]
        squared_force = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
        last = surfaces.start[link + 1]
        if not searched[link] or squared_force <= 0.0 or energy > least_energy + 2.0 * ENERGY_CUTOFF:
            # A link that explains the measurement so much worse is hardly ever searched: its own energy will
            # do as a bound.
            is_searched = searched[link] and squared_force > 0.0
            for p in range(surfaces.start[link], last):
                candidates.bound[p] = energy if is_searched else math.inf
            continue
        for first in range(surfaces.start[link], last, LANES):
            end = min(first + LANES, last)
            _load_spheres(surface, prior.surface_deviation, first, end, spheres)
            shift_energies(w, hypotheses.covariance[link], squared_force, spheres)
            for p in range(first, end):
                bound = energy + spheres[SHIFT_ENERGY + p - first]
                candidates.bound[p] = bound
                lowest = min(lowest, bound)
                near += 1 if bound <= least_energy + ENERGY_CUTOFF else 0
            if near > most_primitives:
                return -math.inf
    return lowest


@fused_kernel
def _search_block(
    surface: PlacedSurface,
    rows: np.ndarray,
    hypotheses: Hypotheses,
    prior: Prior,
    block: np.ndarray,
    candidates: Candidates,
    best: tuple[float, float],
) -> tuple[float, float]:
    """Search on up to `LANES` primitives at once.

    Args:
        surface, hypotheses, prior: As for `bound_energies`.
        rows: The primitives.
        block: Scratch.
        candidates: Rows are filled.
        best: Lowest energy and best score of the candidates so far, as far as they are accessible.

    Returns:
        The same with those found here.
    """
    surfaces = surface.surfaces
    for j in range(rows.shape[0]):
        p = rows[j]
        link = surfaces.link[p]
        load_primitive(j, surfaces.kind[p], surfaces.size[p], surfaces.radius[p], block)
        load_wrench(j, hypotheses.wrench[link], hypotheses.information[link], block)
        frame = _choose_cell(
            surface, p, hypotheses.wrench[link], hypotheses.information[link], prior, candidates
        )
        load_frame(j, frame.rotation, frame.origin, block)
    wrenches_to_body_frames(block)
    enter_surfaces(surfaces.kind, surfaces.size, rows, block)
    for j in range(rows.shape[0]):
        p = rows[j]
        candidates.score[p] = -math.inf
        _begin_at_entry(j, p, surface, hypotheses, prior, block, candidates)
    # How far a candidate is accessible is known at the end of its search. If the lowest energy has then
    # risen, others are no longer hopeless beside it.
    for _ in range(rows.shape[0]):
        find_posterior_modes(surfaces.kind, surfaces.size, rows, prior, best[0], ENERGY_TOLERANCE, block)
        best = _take_modes(surface, rows, hypotheses, prior, block, candidates, best)
        if not resume_searches(rows.shape[0], best[0], block):
            break
    return best


@fused_kernel
def _choose_cell(
    surface: PlacedSurface, p: int, w: np.ndarray, L: np.ndarray, prior: Prior, candidates: Candidates
) -> Frame:
    """Choose the cell of primitive p in which the line of action of a wrench enters its mean surface, if
    that is not the primitive's own; returns the body frame of the primitive as moved there."""
    deviations, frames, cell = surface.deviations, surface.frames, -1
    if deviations.displacement[p] > 0.0:
        v = candidates.wrench[p]
        to_body_frame(w, L, frames.rotation[p], frames.origin[p], v, candidates.information[p])
        cell = entered_cell(deviations, p, v, prior.friction_ratio)
    candidates.deviation_cell[p] = cell
    frame: Frame = mean_frame(surface, p, cell)
    return frame


@fused_kernel
def _begin_at_entry(
    j: int,
    p: int,
    surface: PlacedSurface,
    hypotheses: Hypotheses,
    prior: Prior,
    block: np.ndarray,
    candidates: Candidates,
) -> None:
    """Begin the search in lane j, on primitive p, where the line of action enters it or comes nearest to
    it."""
    deviations, link = surface.deviations, surface.surfaces.link[p]
    energy = hypotheses.energy[link]
    point = (block[CX + j], block[CY + j], block[CZ + j])
    normal = (block[NX + j], block[NY + j], block[NZ + j])
    force = (block[W0 + j], block[W1 + j], block[W2 + j])
    cell = candidates.deviation_cell[p]
    if cell < 0:
        cell = nearest_cell(deviations, p, point[0], point[1], point[2])
        candidates.deviation_cell[p] = cell
    local = prior_in_cell(prior, deviations, cell)
    least_energy = energy
    if block[GAP + j] > 0.0:
        o, offset = surface.frames.origin[p], prior.surface_deviation * deviations.largest[p]
        squared_force = force[0] * force[0] + force[1] * force[1] + force[2] * force[2]
        variance = moment_variance(hypotheses.covariance[link], o[0], o[1], o[2])
        variance += offset * offset * squared_force
        least_energy += shift_energy(block[GAP + j], squared_force, variance)
    load_prior(j, local, block)
    start = Contact(point, normal, pushing_force(force, normal), 0.0)
    begin_search(j, start, energy, least_energy, prior, block)


@fused_kernel
def _take_modes(
    surface: PlacedSurface,
    rows: np.ndarray,
    hypotheses: Hypotheses,
    prior: Prior,
    block: np.ndarray,
    candidates: Candidates,
    best: tuple[float, float],
) -> tuple[float, float]:
    """Store the modes of a block that have been found, as far as they are accessible. Arguments and result as
    for `_search_block`."""
    surfaces, deviations = surface.surfaces, surface.deviations
    lowest_energy, best_score = best
    for j in range(rows.shape[0]):
        if block[SEARCH + j] != CONVERGED:
            continue
        p = rows[j]
        cell = candidates.deviation_cell[p]
        local = prior_in_cell(prior, deviations, cell)
        mode, link_energy = mode_of(j, local, block), hypotheses.energy[surfaces.link[p]]
        block[SEARCH + j] = IDLE
        score = mode.log_evidence - link_energy
        if mode.log_evidence == -math.inf or score < best_score - ENERGY_CUTOFF:
            continue
        frame = mean_frame(surface, p, cell)
        error = surface_error_in_cell(prior, deviations, cell)
        store_candidate(candidates, p, p, frame, mode, error)
        if is_mounting_face(
            surfaces.link[p], candidates.point[p, 2], candidates.normal[p, 2], prior.surface_deviation
        ):
            continue
        candidates.score[p] = score
        apply_accessibility(surface, candidates, p, frame, prior, best_score - ENERGY_CUTOFF)
        best_score = max(best_score, candidates.score[p])
        lowest_energy = min(lowest_energy, link_energy + mode.energy + score - candidates.score[p])
    return lowest_energy, best_score


@fused_kernel
def _load_spheres(
    surface: PlacedSurface, surface_deviation: float, first: int, last: int, spheres: np.ndarray
) -> None:
    """Put the bounding spheres of primitives `first` to `last` - 1 into a block of spheres, base frame;
    `surface_deviation`: as in `Prior`."""
    surfaces, deviations, frames = surface
    for p in range(first, last):
        o, j = frames.origin[p], p - first
        spheres[CENTRE_X + j], spheres[CENTRE_Y + j], spheres[CENTRE_Z + j] = o[0], o[1], o[2]
        spheres[RADIUS + j] = surfaces.radius[p] + deviations.displacement[p]
        spheres[OFFSET + j] = surface_deviation * deviations.largest[p]
