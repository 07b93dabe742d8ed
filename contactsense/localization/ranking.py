"""Ranking of all candidate contacts: link and place are decided together, "none of these" included.

If the fused wrench determines a line of action, the search on each primitive starts where the line enters it
(`contactsense.localization.line_search.line_of_action_search`); if that explains nothing, from many places
near the line (`contactsense.localization.line_search.multistart_search`). Otherwise the whole surface is
searched (`contactsense.localization.surface_search.search`). A line that is only roughly known, and may enter
more than a few primitives, does not count.

The candidates on all links compete by log evidence: fit of the torques and of the base wrench, prior of force
and torsion, and the width of the posterior (`contactsense.solvers.posterior.equations`). So does "none of
these": a wrench that is not caused by a single push on a touchable link, but by a pull, a couple, several
contacts, or a touch on a link that the scene leaves out. If a single contact is sought along a line of
action, so do touches at places that the primitives do not model
(`contactsense.localization.unmodelled_places`).
"""

import math

import numpy as np

from contactsense.isolation.link_hypotheses import Hypotheses
from contactsense.localization.candidates.candidate_buffers import Candidates
from contactsense.localization.line_accuracy import KNOWN, UNKNOWN, line_accuracy
from contactsense.localization.line_search.line_of_action_search import search_along_line_of_action
from contactsense.localization.line_search.multistart_search import search_from_samples
from contactsense.localization.none_of_these import none_of_these_evidence
from contactsense.localization.problem.searched_surface import SearchArrays
from contactsense.localization.problem.single_contact_problem import SingleContactProblem
from contactsense.localization.problem.surface_cells import SurfaceCells
from contactsense.localization.surface.primitive_frames import place_primitives
from contactsense.localization.surface_search.search import search_surface
from contactsense.localization.unmodelled_places import add_unmodelled_places
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.solvers.posterior.contact_prior import Prior, with_surface
from contactsense.solvers.posterior.mode import ENERGY_CUTOFF

ROUGH_SURFACE_FACTOR = 4.0
"""Factor on the surface deviation at ribs, steps and screw heads."""
ROUGH_SURFACE_PROBABILITY = 0.1
"""Prior probability of a contact at such a place."""
FEW_PRIMITIVES = 3
"""A line of action that is roughly known is searched along if it may well enter no more primitives than this.
For more, the search over the surface is faster; and beside the seam of two links, the mode on one of them may
be inside of the other."""
ATTEMPTS, FIRST_WITH_MANY_STARTS = 4, 2
"""Number of attempts, with the usual and with a rough surface in turn; those from this one on are multi-start
searches, and only made if the line of action is known."""


@fused_kernel
def locate_contacts(
    problem: SingleContactProblem,
    arrays: SearchArrays,
    has_unmodelled_places: bool,
    link_probability: np.ndarray,
) -> int:
    """Find and rank all candidate contacts on all links.

    Args:
        problem: The measurement, and where the contact may be.
        arrays: `candidates`, whose `order` lists the ranked ones, and `frames` are filled.
        has_unmodelled_places: Whether touches at places that the primitives do not model compete, if the line
            of action is known.
        link_probability: Filled: probability that each link is touched, shape (links,). One minus their
            sum is the probability of "none of these".

    Returns:
        Number of candidates; 0 if no link can explain the measurement by a push.
    """
    scene, searched, motion, hypotheses, wrench_measured, prior = problem
    surfaces, touchable, depth = scene.surfaces, scene.touchable, scene.depth
    buffers, cells, candidates, frames = arrays
    link = _best_link(searched, 1, hypotheses)
    if link < 0:
        link_probability[:] = 0.0
        return 0
    place_primitives(surfaces, depth, motion, frames)
    accuracy = line_accuracy(searched, depth, motion, hypotheses, link) if wrench_measured else UNKNOWN
    along_line = accuracy != UNKNOWN
    with_prior = with_link_prior(hypotheses, prior, cells)
    lowest_energy = with_prior.energy[_best_link(searched, 1, with_prior)]
    other_link = _best_link(touchable, 0, hypotheses)
    if other_link < 0 or hypotheses.energy[link] <= hypotheses.energy[other_link]:
        other_link = link
    none_evidence, is_touch_left_out = none_of_these_evidence(
        scene.left_out, depth, motion, hypotheses, other_link, prior, buffers
    )
    if _is_hopeless(lowest_energy, 0.0, none_evidence):
        link_probability[:] = 0.0
        return 0
    count, best = 0, none_evidence
    # Each attempt assumes or searches more than the one before, which has explained nothing.
    for attempt in range(ATTEMPTS):
        has_many_starts, is_rough = attempt >= FIRST_WITH_MANY_STARTS, attempt % 2 == 1
        if has_many_starts and not along_line:
            break
        log_share = math.log(ROUGH_SURFACE_PROBABILITY) if is_rough else 0.0
        if _is_hopeless(lowest_energy, log_share, none_evidence):
            continue
        surface_deviation = prior.surface_deviation * (ROUGH_SURFACE_FACTOR if is_rough else 1.0)
        assumed = SingleContactProblem(
            scene, searched, motion, with_prior, wrench_measured,
            with_surface(prior, prior.friction_ratio, surface_deviation),
        )  # fmt: skip
        competing_evidence = none_evidence - log_share
        if along_line:
            cells.unassigned_evidence[:] = -math.inf
            if has_many_starts:
                count = search_from_samples(assumed, arrays, competing_evidence)
            else:
                most = surfaces.kind.shape[0] if accuracy == KNOWN else FEW_PRIMITIVES
                count = search_along_line_of_action(assumed, arrays, competing_evidence, most)
                along_line = count >= 0
        if not along_line:
            count = search_surface(assumed, arrays, competing_evidence)
        best = _add_log_prior(candidates, count, cells.unassigned_evidence, log_share)
        if best >= none_evidence or is_touch_left_out:
            break
    if along_line and has_unmodelled_places:
        count = add_unmodelled_places(problem, arrays, none_evidence, best, count)
    ranked: int = _rank(
        surfaces,
        candidates,
        count,
        2.0 * prior.surface_deviation,
        cells.unassigned_evidence,
        none_evidence,
        link_probability,
    )
    return ranked


@fused_kernel
def _is_hopeless(lowest_energy: float, log_share: float, none_evidence: float) -> bool:
    """Whether no contact can reach the evidence of "none of these".

    The prior on a link integrates to at most the density's factor, which `lowest_energy` contains (the lowest
    of `with_link_prior`), and the likelihood is at most exp(-energy) of the link.
    """
    return log_share - lowest_energy < none_evidence - ENERGY_CUTOFF


@fused_kernel
def with_link_prior(hypotheses: Hypotheses, prior: Prior, cells: SurfaceCells) -> Hypotheses:
    """The hypotheses with the prior over links in their energies: the searches then treat improbable links as
    they treat badly fitting ones."""
    for link in range(hypotheses.energy.shape[0]):
        cells.link_energy[link] = hypotheses.energy[link] - prior.log_link_density[link]
    return Hypotheses(
        hypotheses.wrench,
        hypotheses.covariance,
        hypotheses.information,
        cells.link_energy,
        hypotheses.log_evidence,
    )


@fused_kernel
def _add_log_prior(
    candidates: Candidates, count: int, unassigned_evidence: np.ndarray, log_share: float
) -> float:
    """Add a log prior to the evidence of all candidates; returns the best evidence."""
    best = -math.inf
    for i in range(count):
        row = candidates.order[i]
        candidates.score[row] += log_share
        best = max(best, candidates.score[row])
    for link in range(unassigned_evidence.shape[0]):
        unassigned_evidence[link] += log_share
    return best


@fused_kernel
def _best_link(marks: np.ndarray, mark: int, hypotheses: Hypotheses) -> int:
    """Link with the lowest energy among those with that mark, -1 if there is none."""
    best = -1
    for link in range(marks.shape[0]):
        if marks[link] == mark and (best < 0 or hypotheses.energy[link] < hypotheses.energy[best]):
            best = link
    return best


@fused_kernel
def _rank(
    surfaces: Surfaces,
    candidates: Candidates,
    count: int,
    min_separation: float,
    unassigned_evidence: np.ndarray,
    none_evidence: float,
    link_probability: np.ndarray,
) -> int:
    """Sort the candidates, drop duplicates and improbable ones, and normalize scores to probabilities.

    Args:
        surfaces: Primitives.
        candidates: The candidates, `order` and `probability` are filled.
        count: Number of candidates in `order`.
        min_separation: Candidates on one link closer than this are duplicates [m].
        unassigned_evidence: Log evidence on each link outside all candidates, shape (links,).
        none_evidence: Log evidence of "none of these".
        link_probability: Filled.

    Returns:
        Number of candidates that remain.
    """
    for i in range(count):
        for k in range(i + 1, count):
            if candidates.score[candidates.order[k]] > candidates.score[candidates.order[i]]:
                candidates.order[i], candidates.order[k] = candidates.order[k], candidates.order[i]
    best = max(none_evidence, candidates.score[candidates.order[0]]) if count > 0 else none_evidence
    for link in range(unassigned_evidence.shape[0]):
        best = max(best, unassigned_evidence[link])
    if best == -math.inf:
        link_probability[:] = 0.0
        return 0
    total = math.exp(none_evidence - best)
    for link in range(link_probability.shape[0]):
        unassigned = unassigned_evidence[link]
        link_probability[link] = math.exp(unassigned - best) if unassigned > -math.inf else 0.0
        total += link_probability[link]
    count_kept = 0
    for i in range(count):
        row = candidates.order[i]
        if not candidates.score[row] >= best - ENERGY_CUTOFF:
            break
        if not _is_duplicate(surfaces, candidates, row, count_kept, min_separation):
            candidates.order[count_kept] = row
            candidates.probability[row] = math.exp(candidates.score[row] - best)
            link_probability[surfaces.link[candidates.primitive[row]]] += candidates.probability[row]
            total += candidates.probability[row]
            count_kept += 1
    for i in range(count_kept):
        candidates.probability[candidates.order[i]] /= total
    for link in range(link_probability.shape[0]):
        link_probability[link] /= total
    return count_kept


@fused_kernel
def _is_duplicate(
    surfaces: Surfaces, candidates: Candidates, p: int, count_kept: int, min_separation: float
) -> bool:
    """Whether one of the first `count_kept` candidates is on the same link within `min_separation` [m]."""
    link = surfaces.link[candidates.primitive[p]]
    for i in range(count_kept):
        q = candidates.order[i]
        if surfaces.link[candidates.primitive[q]] == link:
            dx = candidates.point[q, 0] - candidates.point[p, 0]
            dy = candidates.point[q, 1] - candidates.point[p, 1]
            dz = candidates.point[q, 2] - candidates.point[p, 2]
            if dx * dx + dy * dy + dz * dz < min_separation * min_separation:
                return True
    return False
