"""Multi-start search for a contact that the search along the line of action has missed.

That search begins where the line of action enters a primitive. At rims, fillets and steps the force is far
from the primitive's normal, so the torsion moves the line by millimetres and the place by much more: the way
from the entry to the mode leads around an edge. This search begins at all samples of the surface near the
line, and lets the noise decrease in stages to the stated one, as in simulated annealing: with more noise the
valley of the energy is wide, and each stage begins near its bottom.

It takes ten times as long. So it is for measurements that nothing explains so far.
"""

import math

from contactsense.isolation.link_hypotheses import Hypotheses
from contactsense.kinematics.wrench_information import matvec
from contactsense.localization.candidates.accessibility import apply_accessibility, is_mounting_face
from contactsense.localization.candidates.candidate_buffers import Candidates, store_candidate
from contactsense.localization.line_search.line_of_action_search import bound_energies
from contactsense.localization.problem.searched_surface import SearchArrays, SearchedSurface, placed_surface
from contactsense.localization.problem.single_contact_problem import SingleContactProblem
from contactsense.localization.surface.local_prior import nearest_cell, prior_in_cell, surface_error_in_cell
from contactsense.localization.surface.mean_surface import mean_frame
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.localization.surface.surface_samples import SurfaceSamples
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.surface.convex_primitives import Surfaces, project
from contactsense.robots.vectors import Vector, add, cross, dot, rotate, rotate_back, subtract, vector
from contactsense.solvers.posterior.block import SEARCH, W0, W1, W2
from contactsense.solvers.posterior.contact_prior import Contact, Prior, pushing_force
from contactsense.solvers.posterior.mode import (
    CONVERGED,
    ENERGY_CUTOFF,
    ENERGY_TOLERANCE,
    begin_search,
    find_posterior_modes,
    mode_of,
)
from contactsense.solvers.posterior.simd import (
    contact_of,
    load_frame,
    load_primitive,
    load_prior,
    load_wrench,
    scale_information,
    store_contact,
    wrenches_to_body_frames,
)

STAGES = 4
"""Number of stages of falling noise; the last one has that which is stated."""
STAGE_FACTOR = 3.0
"""Factor on the standard deviation of the noise from each stage to the one before."""
REACH = 0.06
"""Searches begin at samples whose cell is nearer to the line of action than this [m], on the side where the
force pushes and on the other: the way to the mode may lead around an edge. With 30 mm, 12 instead of 10 of 27
such contacts have no answer."""
SAME_MODE_SIGMAS = 2.0
"""A place that is nearer to a mode on its primitive than this many standard deviations belongs to it: in a
narrow valley, searches end at different places of its bottom."""
SAME_CELL_DISTANCE = 0.014
"""Where the surface is moved cell by cell, modes that are nearer to each other than this are one [m]: half a
cell of `contactsense.localization.surface.mean_surface`."""


@fused_kernel
def search_from_samples(
    problem: SingleContactProblem, arrays: SearchArrays, competing_evidence: float
) -> int:
    """Find the most probable contacts near the line of action, from many places of the surface.

    Args:
        problem: The measurement, and where the contact may be.
        arrays: With the body frames of the primitives; `candidates` is filled.
        competing_evidence: Log evidence of what else explains the measurement: what is hopeless beside it is
            not searched.

    Returns:
        Number of rows in `order`, one for each mode, and fewer than there are rows.
    """
    scene, hypotheses, prior = problem.scene, problem.hypotheses, problem.prior
    surfaces, samples, searched = scene.surfaces, scene.samples, problem.searched
    cells, candidates, frames = arrays.cells, arrays.candidates, arrays.frames
    surface, primitives = placed_surface(scene, arrays), scene.surfaces.kind.shape[0]
    bound_energies(surface, searched, hypotheses, prior, candidates, primitives)
    count, waiting, best = 0, 0, competing_evidence
    for row in range(candidates.order.shape[0]):
        candidates.order[row] = row
    for p in range(surfaces.start[searched.shape[0]]):
        if not -candidates.bound[p] >= best - ENERGY_CUTOFF:
            continue
        w, R, o = hypotheses.wrench[surfaces.link[p]], frames.rotation[p], vector(frames.origin[p])
        force, about_base = (w[0], w[1], w[2]), (w[3], w[4], w[5])
        moment = rotate_back(R, subtract(about_base, cross(o, force)))
        force = rotate_back(R, force)
        for s in range(samples.start[p], samples.start[p + 1]):
            place = _in_body_frame(surfaces, samples, s)
            if _is_near_line(place, samples.spread[s], force, moment):
                cells.chosen[waiting] = s
                waiting += 1
                if waiting == LANES:
                    count, best = _search_block(scene, hypotheses, prior, arrays, waiting, count, best)
                    waiting = 0
    if waiting > 0:
        count, best = _search_block(scene, hypotheses, prior, arrays, waiting, count, best)
    return count


@fused_kernel
def _in_body_frame(surfaces: Surfaces, samples: SurfaceSamples, s: int) -> Vector:
    """Place of sample s in the body frame of its primitive [m]."""
    p = samples.primitive[s]
    return rotate_back(surfaces.rotation[p], subtract(vector(samples.point[s]), vector(surfaces.origin[p])))


@fused_kernel
def _is_near_line(place: Vector, spread: float, force: Vector, moment: Vector) -> bool:
    """Whether a search begins at a sample.

    Args:
        place: Of the sample [m].
        spread: Standard deviation of its cell along each tangent [m].
        force, moment: Fused wrench, about the origin of the same frame.
    """
    across = cross(force, subtract(moment, cross(place, force)))
    reach = (REACH + 2.0 * spread) * dot(force, force)
    return dot(across, across) <= reach * reach


@fused_kernel
def _search_block(
    scene: SearchedSurface,
    hypotheses: Hypotheses,
    prior: Prior,
    arrays: SearchArrays,
    lanes: int,
    count: int,
    best: float,
) -> tuple[int, float]:
    """Search from the first samples in `SurfaceCells.chosen`, one in each lane.

    Args:
        scene, hypotheses, prior: As in
            `contactsense.localization.problem.single_contact_problem.SingleContactProblem`.
        arrays: As for `search_from_samples`.
        lanes: Number of samples.
        count: Number of modes so far.
        best: Best log evidence so far.

    Returns:
        Number of modes and best log evidence, with those found here.
    """
    surfaces, deviations, samples = scene.surfaces, scene.deviations, scene.samples
    surface, block, cells = placed_surface(scene, arrays), arrays.buffers.block, arrays.cells
    for j in range(lanes):
        s = cells.chosen[j]
        p = samples.primitive[s]
        cells.primitive[j] = p
        cell = _deviation_cell(scene, s)
        load_primitive(j, surfaces.kind[p], surfaces.size[p], surfaces.radius[p], block)
        load_wrench(j, hypotheses.wrench[surfaces.link[p]], hypotheses.information[surfaces.link[p]], block)
        frame = mean_frame(surface, p, cell)
        load_frame(j, frame.rotation, frame.origin, block)
        load_prior(j, prior_in_cell(prior, deviations, cell), block)
    wrenches_to_body_frames(block)
    primitives = cells.primitive[:lanes]
    scale_information(STAGE_FACTOR ** (-2.0 * STAGES), block)
    for j in range(lanes):
        contact = _at_sample(scene, surface, cells.chosen[j])
        force = (block[W0 + j], block[W1 + j], block[W2 + j])
        store_contact(j, Contact(contact[0], contact[1], force, 0.0), 0.0, block)
    for stage in range(STAGES):
        scale_information(STAGE_FACTOR**2.0, block)
        for j in range(lanes):
            point, normal, force, torsion = contact_of(j, block)
            energy = hypotheses.energy[surfaces.link[primitives[j]]]
            start = Contact(point, normal, pushing_force(force, normal), torsion)
            begin_search(j, start, energy, energy, prior, block)
        lowest_energy = -best if stage == STAGES - 1 else math.inf
        find_posterior_modes(
            surfaces.kind, surfaces.size, primitives, prior, lowest_energy, ENERGY_TOLERANCE, block
        )
    for j in range(lanes):
        if block[SEARCH + j] == CONVERGED:
            count, best = _take_mode(scene, hypotheses, prior, arrays, j, count, best)
    return count, best


@fused_kernel
def _deviation_cell(scene: SearchedSurface, s: int) -> int:
    """Cell of the primitive's surface to which sample s belongs, -1 if the primitive has none."""
    p = scene.samples.primitive[s]
    place = _in_body_frame(scene.surfaces, scene.samples, s)
    return nearest_cell(scene.deviations, p, place[0], place[1], place[2])


@fused_kernel
def _at_sample(scene: SearchedSurface, surface: PlacedSurface, s: int) -> tuple[Vector, Vector]:
    """Point [m] and outward unit normal at sample s, in the body frame of its primitive as moved there."""
    surfaces, _, frames = surface
    p = scene.samples.primitive[s]
    place = _in_body_frame(surfaces, scene.samples, s)
    if scene.deviations.displacement[p] > 0.0:
        base = add(vector(frames.origin[p]), rotate(frames.rotation[p], place))
        frame = mean_frame(surface, p, _deviation_cell(scene, s))
        place = rotate_back(frame.rotation, subtract(base, vector(frame.origin)))
    _, px, py, pz, nx, ny, nz = project(surfaces.kind[p], surfaces.size[p], place[0], place[1], place[2])
    return (px, py, pz), (nx, ny, nz)


@fused_kernel
def _take_mode(
    scene: SearchedSurface,
    hypotheses: Hypotheses,
    prior: Prior,
    arrays: SearchArrays,
    j: int,
    count: int,
    best: float,
) -> tuple[int, float]:
    """Store the mode in lane j, as far as it is accessible, unless one of the same place is better. Arguments
    and result as for `_search_block`."""
    surfaces, deviations, candidates = scene.surfaces, scene.deviations, arrays.candidates
    surface = placed_surface(scene, arrays)
    s = arrays.cells.chosen[j]
    p, cell = scene.samples.primitive[s], _deviation_cell(scene, s)
    local = prior_in_cell(prior, deviations, cell)
    mode = mode_of(j, local, arrays.buffers.block)
    score = mode.log_evidence - hypotheses.energy[surfaces.link[p]]
    if not score >= best - ENERGY_CUTOFF:
        return count, best
    frame = mean_frame(surface, p, cell)
    place = add(vector(frame.origin), rotate(frame.rotation, mode.contact.point))
    same = SAME_CELL_DISTANCE if deviations.displacement[p] > 0.0 else 0.0
    k = _index_of_mode(candidates, count, p, place, same)
    if k < count and candidates.score[candidates.order[k]] >= score:
        return count, best
    # The row of none so far: only there does it show how far the mode is accessible.
    row = candidates.order[count]
    error = surface_error_in_cell(prior, deviations, cell)
    store_candidate(candidates, row, p, frame, mode, error)
    candidates.score[row] = score
    height, slope = candidates.point[row, 2], candidates.normal[row, 2]
    if is_mounting_face(surfaces.link[p], height, slope, prior.surface_deviation):
        candidates.score[row] = -math.inf
    else:
        apply_accessibility(surface, candidates, row, frame, prior, best - ENERGY_CUTOFF)
    if k == count and count + 1 < candidates.order.shape[0]:
        return count + 1, max(best, candidates.score[row])
    k = k if k < count else _worst(candidates, count)
    if candidates.score[row] > candidates.score[candidates.order[k]]:
        candidates.order[count], candidates.order[k] = candidates.order[k], row
    return count, max(best, candidates.score[row])


@fused_kernel
def _index_of_mode(candidates: Candidates, count: int, p: int, place: Vector, same: float) -> int:
    """Index in `order` of a mode to which a place on primitive p belongs, base frame [m], or that is nearer
    to it than `same` [m]; `count` if there is none."""
    for k in range(count):
        row = candidates.order[k]
        if candidates.primitive[row] == p:
            d, C = subtract(place, vector(candidates.point[row])), candidates.covariance[row]
            variance = dot(d, matvec((vector(C[0]), vector(C[1]), vector(C[2])), d))
            squared = dot(d, d)
            if squared <= same * same or squared * squared <= SAME_MODE_SIGMAS**2 * variance:
                return k
    return count


@fused_kernel
def _worst(candidates: Candidates, count: int) -> int:
    """Index in `order` of the mode with the lowest score."""
    worst = 0
    for k in range(count):
        if candidates.score[candidates.order[k]] < candidates.score[candidates.order[worst]]:
            worst = k
    return worst
