"""Candidates for a touch at a place that the primitives do not model.

The line of action is known, the real normal is not. So the place is at one of the samples near the line, and
the more probable, the more unmodelled places there are and the less the real normal must be tilted for the
force to push. A line that passes the link by has no such place. Neighbouring samples form one candidate. Its
normal is that of the primitive, tilted as far as the force asks for.
"""

import math

import numpy as np

from contactsense.isolation.link_hypotheses import Hypotheses
from contactsense.kinematics.model import Motion
from contactsense.localization.candidate_buffers import Candidates
from contactsense.localization.line_distance import moment_variance
from contactsense.localization.searched_surface import SearchArrays, SearchedSurface
from contactsense.localization.surface_cells import SurfaceCells
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.surface.convex_primitives import project
from contactsense.robots.vectors import (
    Vector,
    add,
    add_scaled,
    cross,
    dot,
    norm,
    rotate,
    rotate_back,
    scale,
    subtract,
    tangents,
    vector,
)
from contactsense.solvers.posterior.contact_prior import Prior

STEEP_TILT = 1.0
"""Standard deviation of the angle between the inward normal and the force at unmodelled places [rad]."""
CLUSTER_RADIUS = 0.03
"""Samples that are nearer to the best one than this form one candidate with it [m]."""
LEAST_SHARE = 0.05
"""Clusters with a smaller share of a link's touches get no candidate."""
LEAST_LOG_WEIGHT = -30.0
"""Samples with a smaller weight, relative to the best one, are left out."""


@fused_kernel
def add_unmodelled_candidates(
    scene: SearchedSurface,
    motion: Motion,
    hypotheses: Hypotheses,
    prior: Prior,
    arrays: SearchArrays,
    link: int,
    least_evidence: float,
    count: int,
) -> int:
    """Divide the evidence of unmodelled places on a link among candidates.

    Args:
        scene, motion, hypotheses, prior: As in `contactsense.localization.ranking.locate_contacts`.
        arrays: `cells.unassigned_evidence` holds the log evidence for places that are normal variables. It is
            replaced by that for places at samples, as far as no candidate has it.
        link: The link.
        least_evidence: There are no candidates if the log evidence is less.
        count: Number of candidates so far.

    Returns:
        Number of candidates with those added.
    """
    cells, candidates = arrays.cells, arrays.candidates
    first, last, total, correction = _weigh_samples(scene, motion, hypotheses, prior, cells, link)
    evidence = cells.unassigned_evidence[link] + correction
    rest = 1.0
    while total > 0.0 and evidence > least_evidence and count < candidates.order.shape[0]:
        best = first
        for s in range(first, last):
            if cells.score[s - first] > cells.score[best - first]:
                best = s
        row = _free_row(candidates, count)
        share = _build(scene, motion, hypotheses, prior, arrays, link, best, row) / total
        if share < LEAST_SHARE:
            break
        candidates.score[row] = evidence + math.log(share)
        candidates.order[count] = row
        count += 1
        rest -= share
    cells.unassigned_evidence[link] = evidence + math.log(rest) if rest > 0.0 else -math.inf
    return count


@fused_kernel
def _weigh_samples(
    scene: SearchedSurface,
    motion: Motion,
    hypotheses: Hypotheses,
    prior: Prior,
    cells: SurfaceCells,
    link: int,
) -> tuple[int, int, float, float]:
    """Write the weight of each sample of a link to `cells.score`.

    Returns:
        First sample, end, sum of the weights, and log of the ratio of the evidence of the samples to that of
        a normal variable with their moments.
    """
    surfaces, samples, moments = scene.surfaces, scene.samples, scene.unmodelled
    first = samples.start[surfaces.start[link]]
    last = samples.start[surfaces.start[link + 1]]
    force, moment, variance = _in_link_frame(scene, motion, hypotheses, prior, link)
    F = norm(force)
    greatest, prior_weight = -math.inf, 0.0
    for s in range(first, last):
        offset = _offset_of_line(vector(samples.point[s]), force, moment)
        squared = variance + samples.spread[s] * samples.spread[s]
        angle = math.acos(max(-1.0, min(1.0, -dot(force, vector(samples.normal[s])) / F)))
        own = math.exp(samples.log_share[s]) * samples.tilt[s] * samples.tilt[s]
        prior_weight += own
        log_weight = math.log(own) if own > 0.0 else -math.inf
        log_weight -= (
            math.log(squared) + 0.5 * dot(offset, offset) / squared + 0.5 * (angle / STEEP_TILT) ** 2
        )
        cells.score[s - first] = log_weight
        greatest = max(greatest, log_weight)
    total = 0.0
    for s in range(first, last):
        relative = cells.score[s - first] - greatest
        cells.score[s - first] = math.exp(relative) if relative > LEAST_LOG_WEIGHT else 0.0
        total += cells.score[s - first]
    if not total > 0.0:
        return first, last, 0.0, -math.inf
    offset = _offset_of_line(vector(moments.centre[link]), force, moment)
    a, b = tangents(scale(1.0 / F, force))
    C = moments.covariance[link]
    caa, cab, cbb = _product(C, a, a) + variance, _product(C, a, b), _product(C, b, b) + variance
    x, y, determinant = dot(offset, a), dot(offset, b), caa * cbb - cab * cab
    energy = 0.5 * (cbb * x * x - 2.0 * cab * x * y + caa * y * y) / determinant
    normal_variable = -energy - 0.5 * math.log(determinant)
    return first, last, total, greatest + math.log(total / prior_weight) - normal_variable


@fused_kernel
def _offset_of_line(place: Vector, force: Vector, moment: Vector) -> Vector:
    """Shortest vector from a place to the line of action of a force with a moment about the origin [m]."""
    about = subtract(moment, cross(place, force))
    return scale(1.0 / dot(force, force), cross(force, about))


@fused_kernel
def _product(C: np.ndarray, a: Vector, b: Vector) -> float:
    """a C b for a matrix C, shape (3, 3)."""
    return float(
        a[0] * (C[0, 0] * b[0] + C[0, 1] * b[1] + C[0, 2] * b[2])
        + a[1] * (C[1, 0] * b[0] + C[1, 1] * b[1] + C[1, 2] * b[2])
        + a[2] * (C[2, 0] * b[0] + C[2, 1] * b[1] + C[2, 2] * b[2])
    )


@fused_kernel
def _in_link_frame(
    scene: SearchedSurface, motion: Motion, hypotheses: Hypotheses, prior: Prior, link: int
) -> tuple[Vector, Vector, float]:
    """Fused force [N] and moment [Nm] in the frame of a link, and the variance of the distance between line
    and surface along each direction across the line [m^2]."""
    body = scene.depth[link]
    R, o = motion.rotation[body], vector(motion.origin[body])
    w = hypotheses.wrench[link]
    force, about_base = (w[0], w[1], w[2]), (w[3], w[4], w[5])
    moment = subtract(about_base, cross(o, force))
    variance = moment_variance(hypotheses.covariance[link], o[0], o[1], o[2]) / (2.0 * dot(force, force))
    variance += prior.surface_deviation**2 + prior.torsion_lever**2
    return rotate_back(R, force), rotate_back(R, moment), variance


@fused_kernel
def _build(
    scene: SearchedSurface,
    motion: Motion,
    hypotheses: Hypotheses,
    prior: Prior,
    arrays: SearchArrays,
    link: int,
    best: int,
    row: int,
) -> float:
    """Write the candidate around sample `best` to a row; returns the weight of its samples, which then have
    none."""
    surfaces, samples = scene.surfaces, scene.samples
    cells, candidates = arrays.cells, arrays.candidates
    p = samples.primitive[best]
    first, last = samples.start[surfaces.start[link]], samples.start[surfaces.start[link + 1]]
    centre = vector(samples.point[best])
    total, mean = 0.0, (0.0, 0.0, 0.0)
    for s in range(first, last):
        offset = subtract(vector(samples.point[s]), centre)
        if cells.score[s - first] > 0.0 and dot(offset, offset) < CLUSTER_RADIUS * CLUSTER_RADIUS:
            total += cells.score[s - first]
            mean = add(mean, scale(cells.score[s - first], offset))
    mean = scale(1.0 / total, mean)
    body = scene.depth[link]
    R, o = motion.rotation[body], vector(motion.origin[body])
    place, normal = _on_primitive(scene, p, add(centre, mean))
    w = hypotheses.wrench[link]
    force = (w[0], w[1], w[2])
    place, normal = (
        add(o, rotate(R, place)),
        least_tilted(rotate(R, normal), force, 2.0 * prior.friction_ratio),
    )
    C = candidates.covariance[row]
    spread = samples.spread[best]
    for i in range(3):
        for k in range(3):
            C[i, k] = spread * spread if i == k else 0.0
    for s in range(first, last):
        offset = subtract(vector(samples.point[s]), centre)
        if cells.score[s - first] > 0.0 and dot(offset, offset) < CLUSTER_RADIUS * CLUSTER_RADIUS:
            d = rotate(R, subtract(offset, mean))
            share = cells.score[s - first] / total
            for i in range(3):
                for k in range(3):
                    C[i, k] += share * d[i] * d[k]
            cells.score[s - first] = 0.0
    candidates.primitive[row] = p
    candidates.torsion[row] = 0.0
    for i in range(3):
        candidates.point[row, i], candidates.normal[row, i] = place[i], normal[i]
        candidates.force[row, i] = force[i]
    return total


@fused_kernel
def least_tilted(normal: Vector, force: Vector, friction: float) -> Vector:
    """The unit normal nearest to `normal` about which a force is in the friction cone.

    Args:
        normal: Outward unit normal.
        force: Force on the surface, not zero [N].
        friction: Coefficient of friction.
    """
    F = norm(force)
    inward = scale(-1.0 / F, force)
    along = dot(normal, inward)
    cosine = 1.0 / math.sqrt(1.0 + friction * friction)
    if along >= cosine:
        return normal
    across = add_scaled(normal, -along, inward)
    length = norm(across)
    direction = scale(1.0 / length, across) if length > 1e-9 else tangents(inward)[0]
    return add(scale(cosine, inward), scale(friction * cosine, direction))


@fused_kernel
def _on_primitive(scene: SearchedSurface, p: int, place: Vector) -> tuple[Vector, Vector]:
    """Point of the surface of primitive p nearest to a place, and its outward normal, link frame [m]."""
    surfaces = scene.surfaces
    R, o = surfaces.rotation[p], vector(surfaces.origin[p])
    x, y, z = rotate_back(R, subtract(place, o))
    _, px, py, pz, nx, ny, nz = project(surfaces.kind[p], surfaces.size[p], x, y, z)
    return add(o, rotate(R, (px, py, pz))), rotate(R, (nx, ny, nz))


@fused_kernel
def _free_row(candidates: Candidates, count: int) -> int:
    """A row that none of the first `count` candidates has."""
    for row in range(candidates.order.shape[0]):
        free = True
        for i in range(count):
            if candidates.order[i] == row:
                free = False
        if free:
            return row
    return -1
