"""Search over the surface, used if the line of action is not known.

Candidates are clusters of the cells that `contactsense.localization.surface_search.surface_evidence`
evaluates: see `contactsense.localization.surface_search.surface_candidate`.
"""

import math

from contactsense.localization.candidates.accessibility import accessible_share, clearance
from contactsense.localization.candidates.candidate_buffers import MAX_CANDIDATES
from contactsense.localization.log_sum import log_add
from contactsense.localization.problem.searched_surface import SearchArrays, placed_surface
from contactsense.localization.problem.single_contact_problem import SingleContactProblem
from contactsense.localization.problem.surface_cells import SurfaceCells
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.localization.surface_search.surface_candidate import build_candidate
from contactsense.localization.surface_search.surface_evidence import evaluate_cells
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.vectors import add, rotate, vector
from contactsense.solvers.posterior.mode import ENERGY_CUTOFF, ENERGY_TOLERANCE, RELATIVE_TOLERANCE

WIDE_POSTERIOR_TOLERANCE = 0.05
"""Tolerance of the energy of the modes of a wide posterior, one whose cells are not divided: the place of a
candidate follows from its cells then."""
MIN_RELATIVE_WEIGHT = 1e-3
"""Cells below this share of the best candidate's weight do not start a candidate of their own."""


@fused_kernel
def search_surface(problem: SingleContactProblem, arrays: SearchArrays, competing_evidence: float) -> int:
    """Find candidates on the whole surface.

    Args:
        problem: The measurement, and where the contact may be.
        arrays: With the body frames of the primitives. Rows of `candidates` are filled, which `order` lists;
            and `cells.unassigned_evidence`, the log evidence on each link that is part of no candidate.
        competing_evidence: Log evidence of what else explains the measurement: cells whose bound is hopeless
            beside it are not searched.

    Returns:
        Number of candidates.
    """
    surfaces, cells, candidates = problem.scene.surfaces, arrays.cells, arrays.candidates
    cells.unassigned_evidence[:] = -math.inf
    rows, best, divided = evaluate_cells(problem, arrays, -competing_evidence)
    if best == -math.inf:
        return 0
    _apply_accessibility(problem, placed_surface(problem.scene, arrays), cells, rows, best)
    count = 0
    top = -math.inf
    for _ in range(MAX_CANDIDATES):
        s = _best_cell(cells, rows)
        if s < 0 or cells.score[s] < max(best - ENERGY_CUTOFF, top + math.log(MIN_RELATIVE_WEIGHT)):
            break
        # The worse a candidate is, the less its accuracy matters.
        tolerance = ENERGY_TOLERANCE if divided else WIDE_POSTERIOR_TOLERANCE
        tolerance += RELATIVE_TOLERANCE * max(top - cells.score[s], 0.0)
        build_candidate(problem, arrays, rows, s, count, tolerance)
        candidates.order[count] = count
        top = max(top, candidates.score[count])
        count += 1
    for s in range(rows):
        if cells.score[s] > best - ENERGY_CUTOFF:
            link = surfaces.link[cells.primitive[s]]
            cells.unassigned_evidence[link] = log_add(cells.unassigned_evidence[link], cells.score[s])
    return count


@fused_kernel
def _apply_accessibility(
    problem: SingleContactProblem, surface: PlacedSurface, cells: SurfaceCells, rows: int, best: float
) -> None:
    """Lower the score of cells that other primitives cover."""
    motion, depth, prior = problem.motion, problem.scene.depth, problem.prior
    for s in range(rows):
        if cells.score[s] < best - ENERGY_CUTOFF:
            continue
        p = cells.primitive[s]
        body = depth[surface.surfaces.link[p]]
        R, o = motion.rotation[body], motion.origin[body]
        place = add(rotate(R, vector(cells.point[s])), vector(o))
        normal = rotate(R, vector(cells.normal[s]))
        free = clearance(surface, p, place, normal, prior.clearance, 0.0)
        if free < 0.0:
            cells.score[s] += math.log(accessible_share(free, prior))


@fused_kernel
def _best_cell(cells: SurfaceCells, rows: int) -> int:
    """Row of the best remaining cell, -1 if there is none."""
    best, best_row = -math.inf, -1
    for s in range(rows):
        if cells.score[s] > best:
            best, best_row = cells.score[s], s
    return best_row
