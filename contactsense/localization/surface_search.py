"""Search over the surface, used if the line of action is not known.

Candidates are clusters of the cells that `contactsense.localization.surface_evidence` evaluates.
"""

import math

import numpy as np

from contactsense.isolation.link_hypotheses import Hypotheses
from contactsense.kinematics.exponential import exponential
from contactsense.kinematics.model import Motion
from contactsense.kinematics.spatial import Six
from contactsense.kinematics.wrench_information import to_body_frame
from contactsense.localization.accessibility import accessible_share, clearance
from contactsense.localization.candidate_buffers import (
    MAX_CANDIDATES,
    Candidates,
    rotate_into,
    store_candidate,
)
from contactsense.localization.ellipse_scale import ellipse_scale
from contactsense.localization.local_prior import DeviationCells, nearest_cell, prior_in_cell, tilt_in_cell
from contactsense.localization.mean_surface import mean_frame
from contactsense.localization.searched_surface import SearchArrays, SearchedSurface
from contactsense.localization.surface_cells import SurfaceCells
from contactsense.localization.surface_evidence import evaluate_cells
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.surface.convex_primitives import Surfaces, project
from contactsense.robots.surface.union import nearest
from contactsense.robots.vectors import Vector, add, rotate, rotate_back, subtract, vector
from contactsense.solvers.posterior import Contact, Prior, pushing_force
from contactsense.solvers.posterior_mode import (
    ENERGY_CUTOFF,
    ENERGY_TOLERANCE,
    RELATIVE_TOLERANCE,
    find_posterior_mode,
)

MERGE_DISTANCE = 0.04
"""Cells within this distance of a candidate's point belong to the candidate [m]."""
MERGE_SIGMAS = 3.0
"""Cells within this many standard deviations belong to it, too."""
MAX_PROJECTIONS = 8
"""Maximum number of projections onto the surface of a link's union of primitives."""
SURFACE_TOLERANCE = 1e-7
"""Points inside the surface by less than this count as on it [m]."""
NARROW_POSTERIOR_CELLS = 2.0
"""A posterior narrower than this many cells is represented by its mode (standard deviations).

The mean over so few cells depends on where they happen to lie.
"""
WIDE_POSTERIOR_TOLERANCE = 0.05
"""Tolerance of the energy of the modes of a wide posterior, one whose cells are not divided: the place of a
candidate is the mean over its cells then."""
LEAST_LOG_WEIGHT = -40.0
"""Least log of the weight of a cell in its candidate, as far as it is computed: none."""
MIN_RELATIVE_WEIGHT = 1e-3
"""Cells below this share of the best candidate's weight do not start a candidate of their own."""


@fused_kernel
def search_surface(
    scene: SearchedSurface,
    searched: np.ndarray,
    motion: Motion,
    hypotheses: Hypotheses,
    wrench_measured: bool,
    prior: Prior,
    arrays: SearchArrays,
    competing_evidence: float,
) -> int:
    """Fill rows of `arrays.candidates`; `order` lists them.

    The log evidence on each link that is not part of any candidate is written to
    `arrays.cells.unassigned_evidence`.

    Args:
        scene, searched, motion, hypotheses, wrench_measured, prior, arrays: As in
            `contactsense.localization.ranking.locate_contacts`, the body frames of the primitives filled in.
        competing_evidence: Log evidence of what else explains the measurement: cells whose bound is hopeless
            beside it are not searched.

    Returns:
        Number of candidates.
    """
    surfaces, depth = scene.surfaces, scene.depth
    _, cells, candidates = arrays
    cells.unassigned_evidence[:] = -math.inf
    rows, best, divided = evaluate_cells(
        scene, searched, motion, hypotheses, wrench_measured, _with_tilt(prior, scene.deviations), arrays,
        -competing_evidence,
    )  # fmt: skip
    if best == -math.inf:
        return 0
    _apply_accessibility(surfaces, scene.deviations, depth, motion, prior, cells, candidates, rows, best)
    count = 0
    top = -math.inf
    for _ in range(MAX_CANDIDATES):
        s = _best_cell(cells, rows)
        if s < 0 or cells.score[s] < max(best - ENERGY_CUTOFF, top + math.log(MIN_RELATIVE_WEIGHT)):
            break
        # The worse a candidate is, the less its accuracy matters.
        tolerance = ENERGY_TOLERANCE if divided else WIDE_POSTERIOR_TOLERANCE
        tolerance += RELATIVE_TOLERANCE * max(top - cells.score[s], 0.0)
        _build_candidate(scene, motion, hypotheses, prior, arrays, rows, s, count, tolerance)
        candidates.order[count] = count
        top = max(top, candidates.score[count])
        count += 1
    for s in range(rows):
        if cells.score[s] > best - ENERGY_CUTOFF:
            link = surfaces.link[cells.primitive[s]]
            cells.unassigned_evidence[link] = _log_add(cells.unassigned_evidence[link], cells.score[s])
    return count


@fused_kernel
def _with_tilt(prior: Prior, deviations: DeviationCells) -> Prior:
    """The prior with the tilt that remains on a mean surface: one for all cells, as a sum over many samples
    hardly depends on how it is distributed."""
    return Prior(
        math.sqrt(prior.friction_ratio * prior.friction_ratio + deviations.mean_tilt * deviations.mean_tilt),
        prior.torsion_lever,
        prior.surface_deviation,
        prior.force,
        prior.clearance,
        prior.area,
        prior.log_link_density,
    )


@fused_kernel
def _log_add(a: float, b: float) -> float:
    """log(exp(a) + exp(b))."""
    high, low = max(a, b), min(a, b)
    return high if low == -math.inf else high + math.log1p(math.exp(low - high))


@fused_kernel
def _apply_accessibility(
    surfaces: Surfaces,
    deviations: DeviationCells,
    depth: np.ndarray,
    motion: Motion,
    prior: Prior,
    cells: SurfaceCells,
    candidates: Candidates,
    rows: int,
    best: float,
) -> None:
    """Lower the score of cells that other primitives cover."""
    for s in range(rows):
        if cells.score[s] < best - ENERGY_CUTOFF:
            continue
        p = cells.primitive[s]
        body = depth[surfaces.link[p]]
        R, o = motion.rotation[body], motion.origin[body]
        n, height = cells.normal[s], prior.clearance
        x = cells.point[s, 0] + height * n[0]
        y = cells.point[s, 1] + height * n[1]
        z = cells.point[s, 2] + height * n[2]
        free = clearance(
            surfaces,
            deviations,
            candidates,
            p,
            o[0] + R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
            o[1] + R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
            o[2] + R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
            0.0,
        )
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


@fused_kernel
def _build_candidate(
    scene: SearchedSurface,
    motion: Motion,
    hypotheses: Hypotheses,
    prior: Prior,
    arrays: SearchArrays,
    rows: int,
    s: int,
    row: int,
    tolerance: float,
) -> None:
    """Build the candidate in row `row` from cell s: its posterior mode, of that tolerance of the energy,
    merged with the cells that belong to it."""
    surfaces, depth = scene.surfaces, scene.depth
    buffers, cells, candidates = arrays
    p = cells.primitive[s]
    link = surfaces.link[p]
    w, L = candidates.wrench[p], candidates.information[p]
    R, o = motion.rotation[depth[link]], motion.origin[depth[link]]
    place = rotate_back(surfaces.rotation[p], subtract(vector(cells.point[s]), vector(surfaces.origin[p])))
    cell = nearest_cell(scene.deviations, p, place[0], place[1], place[2])
    frame = mean_frame(scene.deviations, candidates, p, cell)
    to_body_frame(hypotheses.wrench[link], hypotheses.information[link], frame[0], frame[1], w, L)
    point, normal = _project(surfaces, p, frame, add(rotate(R, vector(cells.point[s])), vector(o)))
    force = rotate_back(frame[0], rotate(R, vector(cells.force[s])))
    start = Contact(point, normal, pushing_force(force, normal), cells.torsion[s])
    local = prior_in_cell(prior, scene.deviations, cell)
    mode = find_posterior_mode(
        surfaces.kind, surfaces.size, cells.primitive[s : s + 1], w, L, local, start, buffers.block, tolerance
    )
    tilt = tilt_in_cell(prior, scene.deviations, cell)
    store_candidate(candidates, row, p, frame, mode, local.surface_deviation, tilt)
    max_variance = max(mode.variances[0], mode.variances[2])
    x, y, z = (
        candidates.point[row, 0] - o[0],
        candidates.point[row, 1] - o[1],
        candidates.point[row, 2] - o[2],
    )
    kx = R[0, 0] * x + R[1, 0] * y + R[2, 0] * z
    ky = R[0, 1] * x + R[1, 1] * y + R[2, 1] * z
    kz = R[0, 2] * x + R[1, 2] * y + R[2, 2] * z
    converged = mode.log_evidence > -math.inf
    merge_radius = (
        max(MERGE_DISTANCE, MERGE_SIGMAS * math.sqrt(max_variance)) if converged else MERGE_DISTANCE
    )
    total, mean, C = _merge_cells(surfaces, cells, rows, s, kx, ky, kz, merge_radius)
    candidates.score[row] = total
    # For a narrow posterior the mode is more accurate than the mean over the cells' tangent planes.
    blend = (
        0.0
        if converged and C[0] + C[3] + C[5] < 2.0 * (NARROW_POSTERIOR_CELLS * cells.spread[s]) ** 2
        else 1.0
    )
    point = _project_onto_link(
        surfaces,
        scene.deviations,
        candidates,
        row,
        link,
        R,
        o,
        kx + blend * mean[0],
        ky + blend * mean[1],
        kz + blend * mean[2],
    )
    dx, dy, dz = point[0] - kx, point[1] - ky, point[2] - kz
    # Second moments about the new point.
    C = (
        C[0] - 2.0 * mean[0] * dx + dx * dx,
        C[1] - mean[0] * dy - mean[1] * dx + dx * dy,
        C[2] - mean[0] * dz - mean[2] * dx + dx * dz,
        C[3] - 2.0 * mean[1] * dy + dy * dy,
        C[4] - mean[1] * dz - mean[2] * dy + dy * dz,
        C[5] - 2.0 * mean[2] * dz + dz * dz,
    )
    if blend > 0.0:
        f = ellipse_scale(cells, rows, point, rotate_back(R, vector(candidates.normal[row])), C)
        C = (f * C[0], f * C[1], f * C[2], f * C[3], f * C[4], f * C[5])
    _set_covariance(candidates, row, R, C, local.surface_deviation)


@fused_kernel
def _project_onto_link(
    surfaces: Surfaces,
    deviations: DeviationCells,
    candidates: Candidates,
    row: int,
    link: int,
    R: np.ndarray,
    o: np.ndarray,
    x: float,
    y: float,
    z: float,
) -> Vector:
    """Move a candidate to the point of the link's mean surface nearest to (x, y, z) [m]; returns that, link
    frame."""
    p, point, normal = -1, (x, y, z), (0.0, 0.0, 0.0)
    for _ in range(MAX_PROJECTIONS):
        # At a concave edge, the surface of one primitive may lie inside another.
        distance, p, point, normal = nearest(surfaces, surfaces.start[link], surfaces.start[link + 1], point)
        if distance > -SURFACE_TOLERANCE:
            break
    candidates.primitive[row] = p
    rotate_into(R, point[0], point[1], point[2], candidates.point[row])
    rotate_into(R, normal[0], normal[1], normal[2], candidates.normal[row])
    for i in range(3):
        candidates.point[row, i] += o[i]
    if deviations.displacement[p] > 0.0:
        local = rotate_back(surfaces.rotation[p], subtract(point, vector(surfaces.origin[p])))
        cell = nearest_cell(deviations, p, local[0], local[1], local[2])
        frame = mean_frame(deviations, candidates, p, cell)
        point, normal = _project(surfaces, p, frame, add(rotate(R, (x, y, z)), vector(o)))
        rotate_into(frame[0], point[0], point[1], point[2], candidates.point[row])
        rotate_into(frame[0], normal[0], normal[1], normal[2], candidates.normal[row])
        for i in range(3):
            candidates.point[row, i] += frame[1][i]
        point = rotate_back(R, subtract(vector(candidates.point[row]), vector(o)))
    return point


@fused_kernel
def _project(
    surfaces: Surfaces, p: int, frame: tuple[np.ndarray, np.ndarray], point: Vector
) -> tuple[Vector, Vector]:
    """Point on primitive p nearest to `point`, base frame, and the outward normal there, in the primitive's
    body frame `frame`."""
    x, y, z = rotate_back(frame[0], subtract(point, vector(frame[1])))
    _, px, py, pz, nx, ny, nz = project(surfaces.kind[p], surfaces.size[p], x, y, z)
    return (px, py, pz), (nx, ny, nz)


@fused_kernel
def _merge_cells(
    surfaces: Surfaces, cells: SurfaceCells, rows: int, s: int, x: float, y: float, z: float, radius: float
) -> tuple[float, Vector, Six]:
    """Merge cell s and the cells of its link within `radius` [m] of the point (x, y, z); they are marked
    as used.

    Returns:
        Log of the total evidence; mean displacement from the point (x, y, z) [m]; and second moments
        about it (xx, xy, xz, yy, yz, zz) [m^2], link frame.
    """
    link = surfaces.link[cells.primitive[s]]
    top = cells.score[s]
    mx, my, mz = 0.0, 0.0, 0.0
    total, xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(rows):
        cells.weight[i] = 0.0
        if cells.score[i] == -math.inf or surfaces.link[cells.primitive[i]] != link:
            continue
        dx, dy, dz = cells.point[i, 0] - x, cells.point[i, 1] - y, cells.point[i, 2] - z
        if i != s and dx * dx + dy * dy + dz * dz > radius * radius:
            continue
        weight = exponential(max(cells.score[i] - top, LEAST_LOG_WEIGHT))
        cells.score[i], cells.weight[i] = -math.inf, weight
        n, v = cells.normal[i], cells.variance[i]
        total += weight
        mx += weight * dx
        my += weight * dy
        mz += weight * dz
        xx += weight * (dx * dx + v * (1.0 - n[0] * n[0]))
        xy += weight * (dx * dy - v * n[0] * n[1])
        xz += weight * (dx * dz - v * n[0] * n[2])
        yy += weight * (dy * dy + v * (1.0 - n[1] * n[1]))
        yz += weight * (dy * dz - v * n[1] * n[2])
        zz += weight * (dz * dz + v * (1.0 - n[2] * n[2]))
    moments = (xx / total, xy / total, xz / total, yy / total, yz / total, zz / total)
    return top + math.log(total), (mx / total, my / total, mz / total), moments


@fused_kernel
def _set_covariance(
    candidates: Candidates, row: int, R: np.ndarray, C: Six, surface_deviation: float
) -> None:
    """Covariance of a candidate's point from second moments C (link frame) and the surface deviation."""
    n = candidates.normal[row]
    for i in range(3):
        a = R[i, 0] * C[0] + R[i, 1] * C[1] + R[i, 2] * C[2]
        b = R[i, 0] * C[1] + R[i, 1] * C[3] + R[i, 2] * C[4]
        c = R[i, 0] * C[2] + R[i, 1] * C[4] + R[i, 2] * C[5]
        for k in range(3):
            candidates.covariance[row, i, k] = (
                a * R[k, 0] + b * R[k, 1] + c * R[k, 2] + surface_deviation * surface_deviation * n[i] * n[k]
            )
