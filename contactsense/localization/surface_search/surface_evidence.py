"""Evidence of all surface cells: of all samples first, then of the subsamples of the best cells.

Cells are processed in blocks of `LANES`, all of a block on one link. Blocks far from the line of action are
skipped. The bound of `contactsense.localization.surface_search.energy_bound` excludes most cells of the
others; those that remain are queued and, lowest bound first, collected in new blocks for
`contactsense.localization.surface_search.laplace_evidence`.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.kinematics.wrench_information import to_body_frame
from contactsense.localization.candidates.place_covariance import from_tangents
from contactsense.localization.problem.searched_surface import SearchArrays
from contactsense.localization.problem.single_contact_problem import SingleContactProblem
from contactsense.localization.problem.surface_cells import SurfaceCells
from contactsense.localization.surface.line_distance import (
    CENTRE_X,
    CENTRE_Y,
    CENTRE_Z,
    OFFSET,
    RADIUS,
    SHIFT_ENERGY,
    shift_energies,
    spheres_to_base_frame,
)
from contactsense.localization.surface.primitive_frames import Frame
from contactsense.localization.surface.surface_blocks import SurfaceBlocks
from contactsense.localization.surface.surface_samples import SurfaceSamples, SurfaceSubsamples
from contactsense.localization.surface_search.energy_bound import exclude_cells
from contactsense.localization.surface_search.laplace_evidence import find_modes
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.vectors import dot
from contactsense.solvers.posterior.contact_prior import Prior
from contactsense.solvers.posterior.mode import ENERGY_CUTOFF

from contactsense.localization.surface.simd_layout import (  # isort: skip
    BOUND, CHI, ENERGY, FX, FY, FZ, LOG_EVIDENCE, NX, NY, NZ, PX, PY, PZ, SPREAD, T1X, T1Y, T1Z, T2X, T2Y,
    T2Z, TILT, V11, V12, V22, X, Y, Z,
)  # fmt: skip

SUBDIVIDE_WITHIN = 3.0
"""Cells whose log evidence is within this of the best are replaced by their subsamples ..."""
MAX_SUBDIVIDED = 32
"""... unless there are more of them than this: a wide posterior does not depend on the cell size."""
BOUND_STEP = 2.0
"""Cells whose bounds differ by less than this are evaluated in any order."""
BOUND_GROWTH = 1.5
"""Least ratio of the limits of successive such groups, so that there are few of them."""
LARGEST_BOUND = 1e4
"""Larger bounds count as this: such cells come last."""


class _LinkHypothesis(NamedTuple):
    """What the cells of one link share, besides the wrench in `SurfaceCells`."""

    energy: float
    """Energy of the link's hypothesis."""
    force_deviation: float
    """Root of the trace of the force's covariance [N]."""


class _Found(NamedTuple):
    """What has been found so far."""

    rows: int
    """Number of rows of `SurfaceCells` that are filled."""
    lowest_energy: float
    """Lowest energy of a cell."""


@fused_kernel
def evaluate_cells(
    problem: SingleContactProblem, arrays: SearchArrays, competing_energy: float
) -> tuple[int, float, bool]:
    """Fill a row of `arrays.cells` for each sample or subsample that is not rejected.

    Args:
        problem: The measurement, and where the contact may be.
        arrays: With the body frames of the primitives.
        competing_energy: Energy of what else explains the measurement: cells whose bound is hopeless beside
            it are not evaluated.

    Returns:
        Number of rows; the best log evidence (-infinity if there are none); and whether the best cells were
        divided into subsamples.
    """
    cells = arrays.cells
    found = _evaluate_samples(problem, cells, arrays.candidates.spheres, competing_energy)
    rows = found.rows
    best = _best_score(cells, rows)
    divided = best > -math.inf and _count_above(cells, rows, best - SUBDIVIDE_WITHIN) <= MAX_SUBDIVIDED
    if divided:
        rows = _evaluate_subsamples(problem, cells, best, found)
        best = _best_score(cells, rows)
    return rows, best, divided


@fused_kernel
def _evaluate_samples(
    problem: SingleContactProblem, cells: SurfaceCells, spheres: np.ndarray, competing_energy: float
) -> _Found:
    """Fill a row of `cells` for each sample that is not rejected. `spheres`: scratch block."""
    scene, searched, motion, hypotheses, wrench_measured, prior = problem
    samples, blocks, depth = scene.samples, scene.blocks, scene.depth
    found = _Found(0, math.inf)
    links = searched.shape[0]
    first = np.argmin(hypotheses.energy)
    for k in range(links):
        # The best link first, so that cells on the others are rejected early.
        link = (first + k) % links
        link_energy = hypotheses.energy[link]
        if not searched[link] or link_energy > found.lowest_energy + ENERGY_CUTOFF:
            continue
        R, o = motion.rotation[depth[link]], motion.origin[depth[link]]
        w, P = hypotheses.wrench[link], hypotheses.covariance[link]
        limit = min(found.lowest_energy, competing_energy) + ENERGY_CUTOFF - link_energy
        queued = _queue_cells(
            blocks, link, Frame(R, o), (w, P), wrench_measured, prior, limit, cells, spheres
        )
        if queued == 0:
            continue
        to_body_frame(w, hypotheses.information[link], R, o, cells.wrench, cells.information)
        hypothesis = _LinkHypothesis(link_energy, math.sqrt(_squared_force(w, P)[1]))
        found = _evaluate_queue(samples, queued, hypothesis, prior, found, cells)
    return found


@fused_kernel
def _queue_cells(
    blocks: SurfaceBlocks,
    link: int,
    pose: Frame,
    measured: tuple[np.ndarray, np.ndarray],
    wrench_measured: bool,
    prior: Prior,
    limit: float,
    cells: SurfaceCells,
    spheres: np.ndarray,
) -> int:
    """Queue the cells of a link that the bounds do not exclude; returns their number.

    Args:
        blocks: The cells.
        link: The link.
        pose: Its orientation and origin in the base frame.
        measured: Fused wrench and its covariance, base axes, about the base origin.
        wrench_measured, prior: As in `SingleContactProblem`.
        limit: Energy above which a cell is excluded.
        cells: `queue` and `bound` are filled.
        spheres: Scratch block.
    """
    (R, o), (w, P) = pose, measured
    squared_force, force_variance = _squared_force(w, P)
    skip_far, force_measured = wrench_measured and squared_force > 0.0, force_variance < squared_force
    # The first link has no limit yet: no contact that is kept is that far above its link's energy.
    far_limit = min(limit, 2.0 * ENERGY_CUTOFF)
    queued, last = 0, blocks.start[link + 1]
    for first in range(blocks.start[link], last, LANES):
        end = min(first + LANES, last)
        if skip_far:
            _load_spheres(blocks, first, end, pose, prior.surface_deviation, spheres)
            shift_energies(w, P, squared_force, spheres)
        for b in range(first, end):
            if skip_far and spheres[SHIFT_ENERGY + b - first] > far_limit:
                continue
            if force_measured:
                copy(blocks.cells[b], cells.bound_block[:BOUND])
                exclude_cells(
                    w, P, R, o, squared_force, force_variance, prior.torsion_lever, limit, cells.bound_block,
                    prior.friction_ratio,
                )  # fmt: skip
            else:
                # Without a measured force there is no bound.
                cells.bound_block[BOUND:] = 0.0
            for j in range(blocks.length[b]):
                bound = cells.bound_block[BOUND + j]
                cells.queue[queued] = blocks.sample[b, j]
                cells.bound[queued] = bound if bound < LARGEST_BOUND else LARGEST_BOUND
                queued += 0 if bound == math.inf else 1
    return queued


@fused_kernel
def _evaluate_queue(
    samples: SurfaceSamples,
    queued: int,
    hypothesis: _LinkHypothesis,
    prior: Prior,
    found: _Found,
    cells: SurfaceCells,
) -> _Found:
    """Evaluate the queued cells of a link, in the order of their bounds, until the best energy found excludes
    the others."""
    lowest_bound = math.inf
    for i in range(queued):
        lowest_bound = min(lowest_bound, cells.bound[i])
    upper, first_bound = lowest_bound + BOUND_STEP, lowest_bound
    mode_count = 0
    while queued > 0:
        limit = found.lowest_energy + ENERGY_CUTOFF - hypothesis.energy
        taken, remaining, lowest_bound = 0, 0, math.inf
        # Without branches, which the processor could not predict.
        for i in range(queued):
            sample, bound = cells.queue[i], cells.bound[i]
            is_next, is_later = (bound < upper) & (bound <= limit), (bound >= upper) & (bound <= limit)
            cells.chosen[taken] = sample
            taken += 1 if is_next else 0
            cells.queue[remaining], cells.bound[remaining] = sample, bound
            remaining += 1 if is_later else 0
            lowest_bound = min(lowest_bound, bound if is_later else math.inf)
        for i in range(taken):
            _load_lane(samples, cells.chosen[i], cells.mode_block, cells.mode_sample, mode_count)
            mode_count += 1
            if mode_count == LANES:
                found = _evaluate_block(samples, mode_count, hypothesis, prior, found, cells)
                mode_count = 0
        if mode_count > 0 and lowest_bound > first_bound + ENERGY_CUTOFF:
            # What the block finds probably excludes all others: a full block would take longer.
            found = _evaluate_block(samples, mode_count, hypothesis, prior, found, cells)
            mode_count, first_bound = 0, lowest_bound
        queued, upper = remaining, max(lowest_bound + BOUND_STEP, BOUND_GROWTH * upper)
    if mode_count > 0:
        found = _evaluate_block(samples, mode_count, hypothesis, prior, found, cells)
    return found


@fused_kernel
def _evaluate_subsamples(
    problem: SingleContactProblem, cells: SurfaceCells, best: float, found: _Found
) -> int:
    """Replace the best cells by their subsamples; returns the new number of rows."""
    scene, _, motion, hypotheses, _, prior = problem
    surfaces, subsamples, depth = scene.surfaces, scene.subsamples, scene.depth
    last, mode_count, hypothesis = -1, 0, _LinkHypothesis(0.0, math.inf)
    for row in range(found.rows):
        if cells.score[row] < best - SUBDIVIDE_WITHIN:
            continue
        link = surfaces.link[cells.primitive[row]]
        if link != last:
            if mode_count > 0:
                found = _evaluate_block(subsamples, mode_count, hypothesis, prior, found, cells)
                mode_count = 0
            last = link
            R, o = motion.rotation[depth[link]], motion.origin[depth[link]]
            w, P = hypotheses.wrench[link], hypotheses.covariance[link]
            to_body_frame(w, hypotheses.information[link], R, o, cells.wrench, cells.information)
            hypothesis = _LinkHypothesis(hypotheses.energy[link], math.sqrt(_squared_force(w, P)[1]))
        cells.score[row] = -math.inf
        for s in range(subsamples.start[cells.sample[row]], subsamples.start[cells.sample[row] + 1]):
            _load_lane(subsamples, s, cells.mode_block, cells.mode_sample, mode_count)
            mode_count += 1
            if mode_count == LANES:
                found = _evaluate_block(subsamples, mode_count, hypothesis, prior, found, cells)
                mode_count = 0
    if mode_count > 0:
        found = _evaluate_block(subsamples, mode_count, hypothesis, prior, found, cells)
    return found.rows


@fused_kernel
def _squared_force(w: np.ndarray, P: np.ndarray) -> tuple[float, float]:
    """Squared force of a wrench w and the trace of its covariance, of the wrench's covariance P [N^2]."""
    return w[0] * w[0] + w[1] * w[1] + w[2] * w[2], P[0, 0] + P[1, 1] + P[2, 2]


@fused_kernel
def _load_lane(
    samples: SurfaceSamples | SurfaceSubsamples, s: int, block: np.ndarray, indices: np.ndarray, j: int
) -> None:
    """Copy sample s into lane j of a block."""
    c, n = samples.point, samples.normal
    block[X + j], block[Y + j], block[Z + j] = c[s, 0], c[s, 1], c[s, 2]
    block[NX + j], block[NY + j], block[NZ + j] = n[s, 0], n[s, 1], n[s, 2]
    block[SPREAD + j], block[TILT + j] = samples.spread[s], samples.tilt[s]
    indices[j] = s


@fused_kernel
def _evaluate_block(
    samples: SurfaceSamples | SurfaceSubsamples,
    count: int,
    hypothesis: _LinkHypothesis,
    prior: Prior,
    found: _Found,
    cells: SurfaceCells,
) -> _Found:
    """Evaluate a block of samples of a link, and append those that are not rejected."""
    rows, lowest_energy = found
    block, limit = cells.mode_block, lowest_energy + ENERGY_CUTOFF - hypothesis.energy
    find_modes(count, cells.wrench, cells.information, prior, hypothesis.force_deviation, limit, block)
    for j in range(count):
        if block[LOG_EVIDENCE + j] == -math.inf:
            continue
        s = cells.mode_sample[j]
        cells.sample[rows], cells.primitive[rows] = s, samples.primitive[s]
        cells.score[rows] = block[LOG_EVIDENCE + j] - hypothesis.energy + samples.log_share[s]
        force = (block[FX + j], block[FY + j], block[FZ + j])
        normal = (block[NX + j], block[NY + j], block[NZ + j])
        cells.point[rows, 0], cells.point[rows, 1] = block[PX + j], block[PY + j]
        cells.point[rows, 2] = block[PZ + j]
        cells.normal[rows, 0], cells.normal[rows, 1], cells.normal[rows, 2] = normal
        cells.force[rows, 0], cells.force[rows, 1], cells.force[rows, 2] = force
        cells.torsion[rows] = -block[CHI + j] * dot(force, normal)
        _store_covariance(block, j, cells.covariance[rows])
        cells.spread[rows] = samples.spread[s]
        lowest_energy = min(lowest_energy, hypothesis.energy + block[ENERGY + j])
        rows += 1
    return _Found(rows, lowest_energy)


@fused_kernel
def _store_covariance(block: np.ndarray, j: int, out: np.ndarray) -> None:
    """Covariance of the place in lane j of a block, along its tangents, in the link frame, shape (6,)."""
    v11, v12, v22 = block[V11 + j], block[V12 + j], block[V22 + j]
    s = (block[T1X + j], block[T1Y + j], block[T1Z + j])
    t = (block[T2X + j], block[T2Y + j], block[T2Z + j])
    covariance = from_tangents((v11, v12, v22), (s, t))
    for i in range(6):
        out[i] = covariance[i]


@fused_kernel
def _count_above(cells: SurfaceCells, rows: int, threshold: float) -> int:
    """Number of rows with a score above the threshold."""
    count = 0
    for s in range(rows):
        if cells.score[s] > threshold:
            count += 1
    return count


@fused_kernel
def _best_score(cells: SurfaceCells, rows: int) -> float:
    """Highest score of all rows, -infinity if there are none."""
    best = -math.inf
    for s in range(rows):
        best = max(best, cells.score[s])
    return best


@fused_kernel
def _load_spheres(
    blocks: SurfaceBlocks,
    first: int,
    last: int,
    pose: Frame,
    offset: float,
    spheres: np.ndarray,
) -> None:
    """Put the spheres of blocks `first` to `last` - 1 of a link with that pose into a block
    of spheres, base frame; `offset`: standard deviation of the surface's offset [m]."""
    for b in range(first, last):
        c, j = blocks.centre[b], b - first
        spheres[CENTRE_X + j], spheres[CENTRE_Y + j], spheres[CENTRE_Z + j] = c[0], c[1], c[2]
        spheres[RADIUS + j], spheres[OFFSET + j] = blocks.radius[b], offset
    spheres_to_base_frame(pose.rotation, pose.origin, spheres)
