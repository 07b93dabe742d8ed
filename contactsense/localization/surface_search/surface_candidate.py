"""One candidate of the search over the surface: a cluster of cells, its place, force and covariance.

The candidate begins at its best cell. Cells near the posterior mode there belong to it. A narrow posterior is
represented by its mode. A wide one is not normal: it is flat up to the ends of the link, or curved around it,
so that its mean has little probability, or lies inside of the link. Its place is where its cells are densest
(`contactsense.localization.surface_search.mean_shift`), and its force is the most probable one there.
"""

import math

import numpy as np

from contactsense.isolation.link_hypotheses import Hypotheses
from contactsense.kinematics.exponential import exponential
from contactsense.kinematics.spatial import Six
from contactsense.kinematics.wrench_information import to_body_frame
from contactsense.localization.candidates.candidate_buffers import Candidates, rotate_into, store_candidate
from contactsense.localization.candidates.place_covariance import about_another_point, from_tangents
from contactsense.localization.candidates.surface_tails import surface_part
from contactsense.localization.problem.searched_surface import SearchArrays, placed_surface
from contactsense.localization.problem.single_contact_problem import SingleContactProblem
from contactsense.localization.problem.surface_cells import SurfaceCells
from contactsense.localization.surface.local_prior import (
    SurfaceError,
    nearest_cell,
    prior_in_cell,
    surface_error_in_cell,
)
from contactsense.localization.surface.mean_surface import mean_frame
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.localization.surface.primitive_frames import Frame
from contactsense.localization.surface_search.ellipse_scale import ellipse_scale, scaled_along_surface
from contactsense.localization.surface_search.force_at_place import FIXED_SPREAD, force_at_place
from contactsense.localization.surface_search.mean_shift import mean_shift
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.surface.convex_primitives import Surfaces, project
from contactsense.robots.surface.union import nearest
from contactsense.robots.vectors import Vector, add, dot, rotate, rotate_back, subtract, vector
from contactsense.solvers.posterior.contact_prior import Contact, Prior, pushing_force
from contactsense.solvers.posterior.mode import Mode, find_posterior_mode

MERGE_DISTANCE = 0.04
"""Cells within this distance of a candidate's point belong to the candidate [m]: the one in which it is and
those beside it. The edges of cells, sqrt(12) `spread`, have medians of 27 mm (UR3e) to 56 mm (UR20).

The value is not critical. With 20 and 80 mm, regions hold the true place as often within 0.5 percentage
points, and the errors of stated probabilities differ by less than 0.01: by
`contactsense.benchmarks.accuracy.calibration`, for 700 static contacts each of UR5e and UR10e, torques alone
at 0.3 and 1 Nm, and the base sensor alone at 1 N, 0.2 Nm."""
MERGE_SIGMAS = 3.0
"""Cells within this many standard deviations belong to it, too."""
MAX_PROJECTIONS = 8
"""Maximum number of projections onto the surface of a link's union of primitives."""
SURFACE_TOLERANCE = 1e-7
"""Points inside the surface by less than this count as on it [m]."""
NARROW_POSTERIOR_CELLS = 2.0
"""A posterior narrower than this many cells is represented by its mode (standard deviations).

What follows from so few cells depends on where they happen to lie.
"""
LEAST_LOG_WEIGHT = -40.0
"""Least log of the weight of a cell in its candidate, as far as it is computed: none."""


@fused_kernel
def build_candidate(
    problem: SingleContactProblem, arrays: SearchArrays, rows: int, s: int, row: int, tolerance: float
) -> None:
    """Build a candidate from its best cell: the posterior mode there, merged with the cells that belong to
    it.

    Args:
        problem: The measurement, and where the contact may be.
        arrays: With `rows` evaluated cells; of these, those that are merged are marked as used.
        rows: Number of cells.
        s: The best cell.
        row: Row of the candidate, which is filled.
        tolerance: Tolerance of the energy of the mode.
    """
    scene, _, motion, hypotheses, _, prior = problem
    surfaces, depth, surface = scene.surfaces, scene.depth, placed_surface(scene, arrays)
    buffers, cells, candidates, _ = arrays
    p = cells.primitive[s]
    link = surfaces.link[p]
    w, L = candidates.wrench[p], candidates.information[p]
    pose = Frame(motion.rotation[depth[link]], motion.origin[depth[link]])
    R, o = pose
    place = rotate_back(surfaces.rotation[p], subtract(vector(cells.point[s]), vector(surfaces.origin[p])))
    cell = nearest_cell(scene.deviations, p, place[0], place[1], place[2])
    frame = mean_frame(surface, p, cell)
    to_body_frame(hypotheses.wrench[link], hypotheses.information[link], frame.rotation, frame.origin, w, L)
    point, normal = _project(surfaces, p, frame, add(rotate(R, vector(cells.point[s])), vector(o)))
    force = rotate_back(frame.rotation, rotate(R, vector(cells.force[s])))
    start = Contact(point, normal, pushing_force(force, normal), cells.torsion[s])
    local = prior_in_cell(prior, scene.deviations, cell)
    mode = find_posterior_mode(
        surfaces.kind, surfaces.size, cells.primitive[s : s + 1], w, L, local, start, buffers.block, tolerance
    )
    error = surface_error_in_cell(prior, scene.deviations, cell)
    store_candidate(candidates, row, p, frame, mode, error)
    # Before `frame`, which is scratch, becomes that of the primitive on which the candidate ends.
    by_surface = _covariance_by_surface(mode, error, frame, R)
    max_variance = max(mode.variances[0], mode.variances[2])
    centre = rotate_back(R, subtract(vector(candidates.point[row]), vector(o)))
    converged = mode.log_evidence > -math.inf
    merge_radius = (
        max(MERGE_DISTANCE, MERGE_SIGMAS * math.sqrt(max_variance)) if converged else MERGE_DISTANCE
    )
    members, total, mean, C = _merge_cells(surfaces, cells, rows, s, centre, merge_radius)
    candidates.score[row] = total
    # For a narrow posterior the mode is more accurate than what follows from the cells' tangent planes.
    narrow = converged and C[0] + C[3] + C[5] < 2.0 * (NARROW_POSTERIOR_CELLS * cells.spread[s]) ** 2
    shift = (0.0, 0.0, 0.0) if narrow else mean_shift(cells.members[:, :members], mean)
    dense = add(centre, shift)
    point = _project_onto_link(surface, candidates, row, link, pose, dense)
    if not narrow or not _pushes(candidates, row):
        nearest_row = _nearest_cell(cells, rows, point, rotate_back(R, vector(candidates.normal[row])))
        force = rotate(R, vector(cells.force[nearest_row]))
        if dot(force, vector(candidates.normal[row])) >= 0.0:
            # No cell is on the face that is nearest, as at a thin edge.
            place = vector(cells.point[nearest_row])
            point = _project_onto_link(surface, candidates, row, link, pose, place)
        _fit_force(hypotheses, link, pose, local, point, cells, candidates, row)
    C = about_another_point(C, mean, subtract(point, centre))
    if converged:
        # The evidence of cells is that of contacts on the primitive itself.
        C = (
            C[0] + by_surface[0],
            C[1] + by_surface[1],
            C[2] + by_surface[2],
            C[3] + by_surface[3],
            C[4] + by_surface[4],
            C[5] + by_surface[5],
        )
    if not narrow:
        normal = rotate_back(R, vector(candidates.normal[row]))
        C = scaled_along_surface(C, normal, ellipse_scale(cells, rows, point, normal, C))
    _set_covariance(candidates, row, R, C, local.surface_deviation)


@fused_kernel
def _pushes(candidates: Candidates, row: int) -> bool:
    """Whether a candidate's force pushes on the surface at its place."""
    return dot(vector(candidates.force[row]), vector(candidates.normal[row])) < 0.0


@fused_kernel
def _fit_force(
    hypotheses: Hypotheses,
    link: int,
    pose: Frame,
    prior: Prior,
    point: Vector,
    cells: SurfaceCells,
    candidates: Candidates,
    row: int,
) -> None:
    """Give a candidate the most probable force and torsion of a contact at its place. `pose`: of the link;
    `point`: the place, link frame [m]."""
    (R, o), P = pose, hypotheses.covariance[link]
    to_body_frame(
        hypotheses.wrench[link], hypotheses.information[link], R, o, cells.wrench, cells.information
    )
    deviation = math.sqrt(P[0, 0] + P[1, 1] + P[2, 2])
    normal = rotate_back(R, vector(candidates.normal[row]))
    force, candidates.torsion[row] = force_at_place(
        cells.wrench, cells.information, prior, deviation, point, normal, FIXED_SPREAD, cells.mode_block
    )
    rotate_into(R, force[0], force[1], force[2], candidates.force[row])


@fused_kernel
def _project_onto_link(
    surface: PlacedSurface,
    candidates: Candidates,
    row: int,
    link: int,
    pose: Frame,
    start: Vector,
) -> Vector:
    """Move a candidate to the point of the link's mean surface nearest to `start`, link frame [m]; returns
    that. `pose`: of the link."""
    surfaces, deviations, _ = surface
    R, o = pose
    p, point, normal = -1, start, (0.0, 0.0, 0.0)
    for _ in range(MAX_PROJECTIONS):
        # At a concave edge, the surface of one primitive may lie inside another.
        distance, p, point, normal = nearest(surfaces, surfaces.start[link], surfaces.start[link + 1], point)
        if distance > -SURFACE_TOLERANCE:
            break
    candidates.primitive[row] = p
    rotate_into(R, normal[0], normal[1], normal[2], candidates.normal[row])
    rotate_into(R, point[0], point[1], point[2], candidates.point[row])
    for i in range(3):
        candidates.point[row, i] += o[i]
    if deviations.displacement[p] > 0.0:
        local = rotate_back(surfaces.rotation[p], subtract(point, vector(surfaces.origin[p])))
        cell = nearest_cell(deviations, p, local[0], local[1], local[2])
        frame = mean_frame(surface, p, cell)
        point, normal = _project(surfaces, p, frame, add(rotate(R, start), vector(o)))
        rotate_into(frame.rotation, point[0], point[1], point[2], candidates.point[row])
        rotate_into(frame.rotation, normal[0], normal[1], normal[2], candidates.normal[row])
        for i in range(3):
            candidates.point[row, i] += frame.origin[i]
        point = rotate_back(R, subtract(vector(candidates.point[row]), vector(o)))
    return point


@fused_kernel
def _project(surfaces: Surfaces, p: int, frame: Frame, point: Vector) -> tuple[Vector, Vector]:
    """Point on primitive p nearest to `point`, base frame, and the outward normal there, in the primitive's
    body frame `frame`."""
    x, y, z = rotate_back(frame.rotation, subtract(point, vector(frame.origin)))
    _, px, py, pz, nx, ny, nz = project(surfaces.kind[p], surfaces.size[p], x, y, z)
    return (px, py, pz), (nx, ny, nz)


@fused_kernel
def _merge_cells(
    surfaces: Surfaces, cells: SurfaceCells, rows: int, s: int, centre: Vector, radius: float
) -> tuple[int, float, Vector, Six]:
    """Merge cell s and the cells of its link within `radius` [m] of `centre`; they are marked as used, and
    listed in `cells.members`.

    Returns:
        Number of members; log of the total evidence; mean displacement from the centre [m]; and second
        moments about it (xx, xy, xz, yy, yz, zz) [m^2], link frame.
    """
    link = surfaces.link[cells.primitive[s]]
    top = cells.score[s]
    members, (x, y, z) = 0, centre
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
        cells.members[0, members], cells.members[1, members], cells.members[2, members] = dx, dy, dz
        cells.members[3, members] = weight
        members += 1
        V = cells.covariance[i]
        total += weight
        mx += weight * dx
        my += weight * dy
        mz += weight * dz
        xx += weight * (dx * dx + V[0])
        xy += weight * (dx * dy + V[1])
        xz += weight * (dx * dz + V[2])
        yy += weight * (dy * dy + V[3])
        yz += weight * (dy * dz + V[4])
        zz += weight * (dz * dz + V[5])
    moments = (xx / total, xy / total, xz / total, yy / total, yz / total, zz / total)
    return members, top + math.log(total), (mx / total, my / total, mz / total), moments


@fused_kernel
def _covariance_by_surface(mode: Mode, error: SurfaceError, frame: Frame, R: np.ndarray) -> Six:
    """Covariance of a place that the surface's error causes (xx, xy, xz, yy, yz, zz), link frame [m^2].

    Args:
        mode: The candidate's posterior mode, in the axes of `frame`.
        error: Of the surface there.
        frame: Body frame of the primitive.
        R: Orientation of the link in the base frame.
    """
    s11, s12, s22 = surface_part(mode.tangents, mode.contact, error)
    s, t = mode.tangents
    axes = (
        rotate_back(R, rotate(frame.rotation, s)),
        rotate_back(R, rotate(frame.rotation, t)),
    )
    factor = 1.0 / (error.tails * error.tails)
    found: Six = from_tangents((factor * s11, factor * s12, factor * s22), axes)
    return found


@fused_kernel
def _nearest_cell(cells: SurfaceCells, rows: int, point: Vector, normal: Vector) -> int:
    """Row of the candidate's cell that is nearest to a point in position and normal, link frame.

    A normal that differs by 90 degrees counts as the edge of a cell, as where cells are made
    (`contactsense.localization.surface.surface_samples`): the nearest cell around an edge has another force.
    """
    best, least = -1, math.inf
    for i in range(rows):
        if cells.weight[i] > 0.0:
            d = subtract(vector(cells.point[i]), point)
            squared_edge = 12.0 * cells.spread[i] * cells.spread[i]
            distance = dot(d, d) + squared_edge * (1.0 - dot(normal, vector(cells.normal[i])))
            if distance < least:
                best, least = i, distance
    return best


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
