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
from contactsense.localization.line_distance import (
    CENTRE_X,
    CENTRE_Y,
    CENTRE_Z,
    OFFSET,
    RADIUS,
    SHIFT_ENERGY,
    VARIANCE,
    moment_variance,
    shift_energies,
    shift_energy,
)
from contactsense.localization.local_prior import DeviationCells, nearest_cell, prior_in_cell
from contactsense.localization.mean_surface import entered_cell, mean_frame
from contactsense.localization.simd_layout import LANES
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
        add_cover_energies(surfaces, deviations, hypotheses, prior, candidates, count)
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
        frame = mean_frame(deviations, candidates, p, candidates.deviation_cell[p])
        store_candidate(candidates, p, p, frame, mode, buffers, local.surface_deviation)
        if is_mounting_face(
            surfaces.link[p], candidates.point[p, 2], candidates.normal[p, 2], prior.surface_deviation
        ):
            continue
        candidates.score[p] = score
        apply_accessibility(surfaces, candidates, p, frame, prior, best_score - ENERGY_CUTOFF)
        best_score = max(best_score, candidates.score[p])
        lowest_energy = min(lowest_energy, link_energy + mode.energy + score - candidates.score[p])
    return count


@fused_kernel
def add_cover_energies(
    surfaces: Surfaces,
    deviations: DeviationCells,
    hypotheses: Hypotheses,
    prior: Prior,
    candidates: Candidates,
    count: int,
) -> None:
    """Add to the energies of `initial_guesses` what the candidates lose at least because other primitives
    cover them."""
    for i in range(count):
        p = candidates.order[i]
        candidates.cover_energy[p] = _cover_energy(surfaces, deviations, hypotheses, prior, candidates, p)
        candidates.score[p] += candidates.cover_energy[p]


@fused_kernel
def _cover_energy(
    surfaces: Surfaces,
    deviations: DeviationCells,
    hypotheses: Hypotheses,
    prior: Prior,
    candidates: Candidates,
    p: int,
) -> float:
    """Least loss of log evidence of a contact on primitive p because other primitives cover it: that of the
    most accessible place within the uncertainty of the initial guess."""
    R, o = mean_frame(deviations, candidates, p, candidates.deviation_cell[p])
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
    count, spheres = 0, candidates.spheres
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
        last = surfaces.start[link + 1]
        for first in range(surfaces.start[link], last, LANES):
            lanes = min(LANES, last - first)
            _load_spheres(surfaces, deviations, prior, candidates, first, first + lanes)
            shift_energies(w, P, squared_force, spheres)
            # First those whose spheres the line meets: they set a bound that excludes most of the others.
            for k in range(2 * lanes):
                lane = k % lanes
                energy_of_sphere = spheres[SHIFT_ENERGY + lane]
                limit = ceiling + ENERGY_CUTOFF - link_energy
                if (energy_of_sphere == 0.0) != (k < lanes) or energy_of_sphere > limit:
                    continue
                p = first + lane
                kind, size, radius = surfaces.kind[p], surfaces.size[p], surfaces.radius[p]
                v, B = candidates.wrench[p], candidates.information[p]
                to_body_frame(w, L, candidates.rotation[p], candidates.origin[p], v, B)
                cell = -1
                if deviations.displacement[p] > 0.0:
                    cell = entered_cell(deviations, p, v, prior.friction_ratio)
                    R, o = mean_frame(deviations, candidates, p, cell)
                    to_body_frame(w, L, R, o, v, B)
                wrench = Wrench((v[0], v[1], v[2]), (v[3], v[4], v[5]))
                distance, point, normal = enter_surface(kind, size, radius, wrench)
                if distance > 0.0 and shift_energy(distance, squared_force, spheres[VARIANCE + lane]) > limit:
                    continue
                contact = Contact(point, normal, pushing_force(wrench.force, normal), 0.0)
                if cell < 0:
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
def _load_spheres(
    surfaces: Surfaces,
    deviations: DeviationCells,
    prior: Prior,
    candidates: Candidates,
    first: int,
    last: int,
) -> None:
    """Put the bounding spheres of primitives `first` to `last` - 1 into `candidates.spheres`, base frame."""
    spheres = candidates.spheres
    for p in range(first, last):
        o, j = candidates.origin[p], p - first
        spheres[CENTRE_X + j], spheres[CENTRE_Y + j], spheres[CENTRE_Z + j] = o[0], o[1], o[2]
        spheres[RADIUS + j] = surfaces.radius[p] + deviations.displacement[p]
        spheres[OFFSET + j] = prior.surface_deviation * deviations.largest[p]
