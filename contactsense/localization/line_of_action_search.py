"""Search for the contact if the line of action is known: one posterior mode on every primitive near the
line."""

import math

import numpy as np

from contactsense.isolation.link_hypotheses import Hypotheses
from contactsense.kinematics.wrench_information import to_body_frame
from contactsense.localization.accessibility import (
    CLEARANCE_SIGMAS,
    accessible_share,
    apply_accessibility,
    clearance,
    is_mounting_face,
)
from contactsense.localization.candidate_buffers import Candidates, store_candidate
from contactsense.localization.local_prior import DeviationCells, nearest_cell, prior_in_cell
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.robots.vectors import dot, vector
from contactsense.solvers.line_of_action import enter_surface
from contactsense.solvers.posterior import (
    Contact,
    Prior,
    SearchBuffers,
    energy_at,
    inflate_by_surface_deviation,
    pushing_force,
)
from contactsense.solvers.posterior_mode import ENERGY_CUTOFF, find_posterior_mode
from contactsense.solvers.wrench import Wrench


@fused_kernel
def search_along_line_of_action(
    surfaces: Surfaces,
    deviations: DeviationCells,
    touchable: np.ndarray,
    hypotheses: Hypotheses,
    prior: Prior,
    buffers: SearchBuffers,
    candidates: Candidates,
) -> int:
    """Find the most probable contact on each primitive near the line of action, conditioned on being
    accessible; row p is for primitive p.

    Args:
        surfaces, touchable, hypotheses, prior, buffers, candidates: As in
            `contactsense.localization.ranking.locate_contacts`, the body frames of the primitives filled
            in.
        deviations: How far the surface is from the primitives, place by place.

    Returns:
        Number of rows in `order`. The `score` of rejected rows is -infinity.
    """
    count: int = initial_guesses(surfaces, deviations, touchable, hypotheses, prior, candidates, buffers)
    if count > 1:
        add_cover_energies(surfaces, hypotheses, prior, candidates, count)
    # Of the candidates so far, as far as they are accessible.
    lowest_energy, best_score = math.inf, -math.inf
    for i in range(count):
        # Lowest energy first, so that the others are rejected early.
        for k in range(i + 1, count):
            if candidates.score[candidates.order[k]] < candidates.score[candidates.order[i]]:
                candidates.order[i], candidates.order[k] = candidates.order[k], candidates.order[i]
        p = candidates.order[i]
        link_energy = hypotheses.energy[surfaces.link[p]]
        limit = (
            lowest_energy + ENERGY_CUTOFF - link_energy - (candidates.cover_energy[p] if count > 1 else 0.0)
        )
        candidates.score[p] = -math.inf
        if limit < 0.0:
            continue
        w, c, n = candidates.wrench[p], candidates.point[p], candidates.normal[p]
        normal = vector(n)
        start = Contact(vector(c), normal, pushing_force(vector(w), normal), 0.0)
        local = prior_in_cell(prior, deviations, candidates.deviation_cell[p])
        mode = find_posterior_mode(
            surfaces.kind[p], surfaces.size[p], w, candidates.information[p], local, limit, start, buffers
        )
        score = mode.log_evidence - link_energy
        if mode.log_evidence == -math.inf or score < best_score - ENERGY_CUTOFF:
            continue
        store_candidate(candidates, p, p, mode, buffers, local.surface_deviation)
        if is_mounting_face(
            surfaces.link[p], candidates.point[p, 2], candidates.normal[p, 2], prior.surface_deviation
        ):
            continue
        candidates.score[p] = score
        apply_accessibility(surfaces, candidates, p, prior, best_score - ENERGY_CUTOFF)
        best_score = max(best_score, candidates.score[p])
        lowest_energy = min(lowest_energy, link_energy + mode.energy + score - candidates.score[p])
    return count


@fused_kernel
def add_cover_energies(
    surfaces: Surfaces, hypotheses: Hypotheses, prior: Prior, candidates: Candidates, count: int
) -> None:
    """Add to the energies of `initial_guesses` what the candidates lose at least because other primitives
    cover them."""
    for i in range(count):
        p = candidates.order[i]
        candidates.cover_energy[p] = _cover_energy(surfaces, hypotheses, prior, candidates, p)
        candidates.score[p] += candidates.cover_energy[p]


@fused_kernel
def _cover_energy(
    surfaces: Surfaces, hypotheses: Hypotheses, prior: Prior, candidates: Candidates, p: int
) -> float:
    """Least loss of log evidence of a contact on primitive p because other primitives cover it: that of the
    most accessible place within the uncertainty of the initial guess."""
    R, o = candidates.rotation[p], candidates.origin[p]
    c, n, height = candidates.point[p], candidates.normal[p], prior.clearance
    x, y, z = c[0] + height * n[0], c[1] + height * n[1], c[2] + height * n[2]
    margin = clearance(
        surfaces,
        candidates,
        p,
        o[0] + R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
        o[1] + R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
        o[2] + R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
        0.0,
    )
    if margin >= 0.0:
        return 0.0
    push = -dot(pushing_force(vector(candidates.wrench[p]), vector(n)), vector(n))
    variance = moment_variance(hypotheses.covariance[surfaces.link[p]], o[0], o[1], o[2])
    margin += CLEARANCE_SIGMAS * (math.sqrt(variance) / push + prior.surface_deviation)
    return -math.log(accessible_share(margin, prior))


@fused_kernel
def initial_guesses(
    surfaces: Surfaces,
    deviations: DeviationCells,
    touchable: np.ndarray,
    hypotheses: Hypotheses,
    prior: Prior,
    candidates: Candidates,
    buffers: SearchBuffers,
) -> int:
    """Initial guess on every touchable primitive near the line of action.

    The guess is the point where the line enters the primitive, or the nearest point; it is written to
    `point` and `normal` in the body frame, its energy to `score`, and its row to `order`. Primitives are
    skipped if the line passes too far from them to be explained by noise.

    Returns:
        Number of guesses.
    """
    ceiling = math.inf
    count = 0
    last_link, last_energy = -1, -math.inf
    for _ in range(touchable.shape[0]):
        # Links by rising energy: the first ones set a bound that excludes the last ones.
        link, link_energy = -1, math.inf
        for k in range(touchable.shape[0]):
            e = hypotheses.energy[k]
            unvisited = e > last_energy or (e == last_energy and k > last_link)
            if touchable[k] and unvisited and (link < 0 or e < link_energy):
                link, link_energy = k, e
        if link < 0 or link_energy > ceiling + ENERGY_CUTOFF:
            break
        last_link, last_energy = link, link_energy
        w, P, L = hypotheses.wrench[link], hypotheses.covariance[link], hypotheses.information[link]
        fx, fy, fz = w[0], w[1], w[2]
        squared_force = fx * fx + fy * fy + fz * fz
        if squared_force <= 0.0:
            continue
        for p in range(surfaces.start[link], surfaces.start[link + 1]):
            ox, oy, oz = candidates.origin[p, 0], candidates.origin[p, 1], candidates.origin[p, 2]
            mx, my, mz = w[3] - oy * fz + oz * fy, w[4] - oz * fx + ox * fz, w[5] - ox * fy + oy * fx
            ax, ay, az = fy * mz - fz * my, fz * mx - fx * mz, fx * my - fy * mx
            kind, size, radius = surfaces.kind[p], surfaces.size[p], surfaces.radius[p]
            limit = ceiling + ENERGY_CUTOFF - link_energy
            offset = prior.surface_deviation * deviations.largest[p]
            sphere_distance = math.sqrt(ax * ax + ay * ay + az * az) / squared_force - radius
            variance = moment_variance(P, ox, oy, oz) + offset * offset * squared_force
            if sphere_distance > 0.0 and _shift_energy(sphere_distance, squared_force, variance) > limit:
                continue
            v, B = candidates.wrench[p], candidates.information[p]
            to_body_frame(w, L, candidates.rotation[p], candidates.origin[p], v, B)
            wrench = Wrench((v[0], v[1], v[2]), (v[3], v[4], v[5]))
            distance, point, normal = enter_surface(kind, size, radius, wrench)
            if distance > 0.0 and _shift_energy(distance, squared_force, variance) > limit:
                continue
            contact = Contact(point, normal, pushing_force(wrench.force, normal), 0.0)
            cell = nearest_cell(deviations, p, point[0], point[1], point[2])
            local = prior_in_cell(prior, deviations, cell)
            inflation = inflate_by_surface_deviation(B, local, contact)
            energy = link_energy + energy_at(v, B, local, inflation, contact)
            ceiling = min(ceiling, energy)
            candidates.point[p, 0], candidates.point[p, 1], candidates.point[p, 2] = point
            candidates.normal[p, 0], candidates.normal[p, 1], candidates.normal[p, 2] = normal
            candidates.score[p] = energy
            candidates.deviation_cell[p] = cell
            candidates.order[count] = p
            count += 1
    return count


@fused_kernel
def _shift_energy(distance: float, squared_force: float, variance: float) -> float:
    """Approximate energy of moving the line of action by `distance` [m] towards a point.

    The moment about the point must change by |f| times the distance. `squared_force`: |f|^2 [N^2]. `variance`
    of the moment: of the measurement, and of the surface's offset times |f| [Nm^2].
    """
    return 0.5 * squared_force * distance * distance / variance


@fused_kernel
def moment_variance(P: np.ndarray, ox: float, oy: float, oz: float) -> float:
    """Trace of the covariance of the moment about the point o [Nm^2].

    P: covariance of the wrench about the origin, shape (6, 6). ox, oy, oz: the point [m].
    """
    cross = oz * (P[0, 4] - P[1, 3]) + oy * (P[2, 3] - P[0, 5]) + ox * (P[1, 5] - P[2, 4])
    oo = ox * ox + oy * oy + oz * oz
    oPo = (
        ox * (P[0, 0] * ox + 2.0 * P[0, 1] * oy + 2.0 * P[0, 2] * oz)
        + oy * (P[1, 1] * oy + 2.0 * P[1, 2] * oz)
        + oz * oz * P[2, 2]
    )
    trace: float = P[3, 3] + P[4, 4] + P[5, 5] - 2.0 * cross + oo * (P[0, 0] + P[1, 1] + P[2, 2]) - oPo
    return max(trace, 0.0)
