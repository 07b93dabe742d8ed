"""Candidates for a touch at a place that the primitives do not model.

The line of action is known, the real normal is not. So the place is on the line, near one of the samples of
the surface. A sample is the more probable, the more unmodelled places there are about it and the less the
real normal must be tilted for the force to push. A line that passes the link by has no such place.

Samples that are near each other along the line form one candidate, on the line. Its normal is that of the
best sample, tilted as far as the force asks for.
"""

import math

import numpy as np

from contactsense.kinematics.wrench_information import matvec
from contactsense.localization.candidates.candidate_buffers import Candidates
from contactsense.localization.problem.searched_surface import SearchArrays
from contactsense.localization.problem.single_contact_problem import SingleContactProblem
from contactsense.localization.problem.surface_cells import SurfaceCells
from contactsense.localization.surface.line_distance import moment_variance
from contactsense.robots.jit.kernel import fused_kernel
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

STEEP_TILT = 1.0
"""Standard deviation of the angle between the inward normal and the force at unmodelled places [rad]."""
_ANGLE = np.linspace(0.0, np.pi, 2001)
MEAN_OVER_DIRECTIONS = float(
    np.trapezoid(np.exp(-0.5 * (_ANGLE / STEEP_TILT) ** 2) * 0.5 * np.sin(_ANGLE), _ANGLE)
)
"""Mean of exp(-1/2 (angle / STEEP_TILT)^2) over forces of all directions."""
CLUSTER_LENGTH = 0.03
"""Samples that are nearer to the best one than this along the line form one candidate with it [m]."""
LEAST_SHARE = 0.05
"""Clusters with a smaller share of a link's touches get no candidate."""
LEAST_LOG_WEIGHT = -30.0
"""Samples with a smaller weight, relative to the best one, are left out."""


@fused_kernel
def add_unmodelled_candidates(
    problem: SingleContactProblem,
    arrays: SearchArrays,
    link: int,
    least_evidence: float,
    count: int,
) -> int:
    """Divide the evidence of unmodelled places on a link among candidates.

    Args:
        problem: The measurement, and where the contact may be.
        arrays: `cells.unassigned_evidence` holds the log evidence for places that are normal variables. It is
            replaced by that for places at samples, as far as no candidate has it.
        link: The link; its fused force is not zero.
        least_evidence: There are no candidates if the log evidence is less.
        count: Number of candidates so far.

    Returns:
        Number of candidates with those added.
    """
    cells, candidates = arrays.cells, arrays.candidates
    first, last, total, correction = _weigh_samples(problem, cells, link)
    evidence = cells.unassigned_evidence[link] + correction
    rest = 1.0
    while evidence > least_evidence and count < candidates.order.shape[0]:
        best = first
        for s in range(first, last):
            if cells.score[s - first] > cells.score[best - first]:
                best = s
        if not cells.score[best - first] > 0.0:
            break
        row = _free_row(candidates, count)
        share = _build(problem, arrays, link, best, row) / total
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
    problem: SingleContactProblem, cells: SurfaceCells, link: int
) -> tuple[int, int, float, float]:
    """Write the weight of each sample of a link to `cells.score`.

    Returns:
        First sample, end, sum of the weights, and log of the ratio of the evidence of the samples to that of
        a normal variable with their moments.
    """
    scene = problem.scene
    surfaces, samples, moments = scene.surfaces, scene.samples, scene.unmodelled
    first = samples.start[surfaces.start[link]]
    last = samples.start[surfaces.start[link + 1]]
    force, moment, variance = _in_link_frame(problem, link)
    direction = scale(1.0 / norm(force), force)
    greatest, prior_weight = -math.inf, 0.0
    for s in range(first, last):
        offset = _offset_of_line(vector(samples.point[s]), force, moment)
        squared = variance + samples.spread[s] * samples.spread[s]
        angle = math.acos(max(-1.0, min(1.0, -dot(direction, vector(samples.normal[s])))))
        own = math.exp(samples.log_share[s]) * samples.tilt[s] * samples.tilt[s]
        prior_weight += own
        log_weight = math.log(own) if own > 0.0 else -math.inf
        log_weight -= (
            math.log(squared) + 0.5 * dot(offset, offset) / squared + 0.5 * (angle / STEEP_TILT) ** 2
        )
        cells.score[s - first] = log_weight
        greatest = max(greatest, log_weight)
    if greatest == -math.inf:
        return first, first, 0.0, -math.inf
    total = 0.0
    for s in range(first, last):
        relative = cells.score[s - first] - greatest
        cells.score[s - first] = math.exp(relative) if relative > LEAST_LOG_WEIGHT else 0.0
        total += cells.score[s - first]
    evidence = greatest + math.log(total / (prior_weight * MEAN_OVER_DIRECTIONS))
    offset = _offset_of_line(vector(moments.centre[link]), force, moment)
    a, b = tangents(direction)
    C = moments.covariance[link]
    rows = (vector(C[0]), vector(C[1]), vector(C[2]))
    caa, cab, cbb = (
        dot(a, matvec(rows, a)) + variance,
        dot(a, matvec(rows, b)),
        dot(b, matvec(rows, b)) + variance,
    )
    x, y, determinant = dot(offset, a), dot(offset, b), caa * cbb - cab * cab
    energy = 0.5 * (cbb * x * x - 2.0 * cab * x * y + caa * y * y) / determinant
    return first, last, total, evidence + energy + 0.5 * math.log(determinant)


@fused_kernel
def _offset_of_line(place: Vector, force: Vector, moment: Vector) -> Vector:
    """Shortest vector from a place to the line of action of a force with a moment about the origin [m]."""
    about = subtract(moment, cross(place, force))
    return scale(1.0 / dot(force, force), cross(force, about))


@fused_kernel
def _in_link_frame(problem: SingleContactProblem, link: int) -> tuple[Vector, Vector, float]:
    """Fused force [N] and moment [Nm] in the frame of a link, and the variance of the distance between line
    of action and contact along each direction across the line [m^2]: that of the line at the centre of the
    unmodelled places, of the surface and of the torsion."""
    scene, _, motion, hypotheses, _, prior = problem
    body = scene.depth[link]
    R, o = motion.rotation[body], vector(motion.origin[body])
    w = hypotheses.wrench[link]
    force, about_base = (w[0], w[1], w[2]), (w[3], w[4], w[5])
    moment = subtract(about_base, cross(o, force))
    x, y, z = add(o, rotate(R, vector(scene.unmodelled.centre[link])))
    variance = moment_variance(hypotheses.covariance[link], x, y, z) / (2.0 * dot(force, force))
    variance += prior.surface_deviation**2 + prior.torsion_lever**2
    return rotate_back(R, force), rotate_back(R, moment), variance


@fused_kernel
def _build(problem: SingleContactProblem, arrays: SearchArrays, link: int, best: int, row: int) -> float:
    """Write the candidate around sample `best` to a row; returns the weight of its samples, which then have
    none.

    Across the line of action the covariance of the place is that of the line; along the line it is that of
    the samples.
    """
    scene, _, motion, hypotheses, _, prior = problem
    surfaces, samples = scene.surfaces, scene.samples
    cells, candidates = arrays.cells, arrays.candidates
    first, last = samples.start[surfaces.start[link]], samples.start[surfaces.start[link + 1]]
    force, moment, across = _in_link_frame(problem, link)
    direction = scale(1.0 / norm(force), force)
    centre = vector(samples.point[best])
    total, first_moment, second_moment = 0.0, 0.0, 0.0
    for s in range(first, last):
        weight = cells.score[s - first]
        distance = dot(subtract(vector(samples.point[s]), centre), direction)
        if weight > 0.0 and abs(distance) < CLUSTER_LENGTH:
            total += weight
            first_moment += weight * distance
            second_moment += weight * distance * distance
            cells.score[s - first] = 0.0
    mean = first_moment / total
    along = max(second_moment / total - mean * mean, 0.0) + samples.spread[best] * samples.spread[best]
    place = add(add_scaled(centre, mean, direction), _offset_of_line(centre, force, moment))
    about = subtract(moment, cross(place, force))
    normal = least_tilted(vector(samples.normal[best]), force, 2.0 * prior.friction_ratio)
    body = scene.depth[link]
    R, o = motion.rotation[body], vector(motion.origin[body])
    candidates.primitive[row] = samples.primitive[best]
    candidates.torsion[row] = dot(about, normal)
    place, normal, line = add(o, rotate(R, place)), rotate(R, normal), rotate(R, direction)
    for i in range(3):
        candidates.point[row, i], candidates.normal[row, i] = place[i], normal[i]
        candidates.force[row, i] = hypotheses.wrench[link, i]
        for k in range(3):
            candidates.covariance[row, i, k] = (along - across) * line[i] * line[k]
            if i == k:
                candidates.covariance[row, i, k] += across
    return total


@fused_kernel
def least_tilted(normal: Vector, force: Vector, friction: float) -> Vector:
    """The unit normal nearest to `normal` about which a force is in the friction cone.

    Args:
        normal: Outward unit normal.
        force: Force on the surface, not zero [N].
        friction: Coefficient of friction.
    """
    inward = scale(-1.0 / norm(force), force)
    along = dot(normal, inward)
    cosine = 1.0 / math.sqrt(1.0 + friction * friction)
    if along >= cosine:
        return normal
    across = add_scaled(normal, -along, inward)
    length = norm(across)
    direction = scale(1.0 / length, across) if length > 1e-9 else tangents(inward)[0]
    return add(scale(cosine, inward), scale(friction * cosine, direction))


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
