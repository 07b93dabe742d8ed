"""Places of known contacts with free forces, where a normal distribution on one primitive does not describe
them.

A known place is one normal distribution in the tangent plane of one primitive. If it is broad, the place may
be beyond an edge, on the next primitive; and what a measurement leaves of it is no normal distribution about
the optimum: at a rounded edge the normal turns so fast that friction makes the optimum a narrow one, while
most of the probability is on the plane beside it.

So the stated distribution is divided into a mixture of narrower ones, each on the primitive that is nearest
to its middle (Gaussian sum: Alspach & Sorenson 1972, Nonlinear Bayesian estimation using Gaussian sum
approximations). Across the surface a component is as narrow as along it: a place on a face across an edge is
as improbable as one as far away on the same face. The joint optimization is repeated with each, one in each
lane. Nothing within another primitive can be touched, so that the weight of a component is the evidence of
its accessible share. The covariance of the place becomes the mean squared distance of the mixture from the
optimum. If most of the mixture is on other primitives, the explanation becomes that of its best component.
Between explanations, the evidence remains that of the optimum.
"""

import math

import numpy as np

from contactsense.localization.accessibility import apply_accessibility
from contactsense.localization.mean_surface_distance import mean_surface_distance
from contactsense.localization.ranking import LINE_OF_ACTION_DEVIATION
from contactsense.multi_contact.buffers import (
    KNOWN_NUMBERS,
    Explanations,
    JointState,
    MultiContactBuffers,
    PlacedSurface,
)
from contactsense.multi_contact.contact_step import set_contact, vector_of
from contactsense.multi_contact.joint_covariance import fill_covariances
from contactsense.multi_contact.joint_optimization import find_joint_modes
from contactsense.multi_contact.known_prior import MIN_POINT_DEVIATION
from contactsense.multi_contact.known_rows import KnownRows
from contactsense.multi_contact.pooled_places import bilinear_form
from contactsense.multi_contact.ranked_sets import order_distinct, store_explanation
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.vectors import Vector, add_scaled, rotate_back, subtract, vector
from contactsense.solvers.posterior import Prior, pushing_force

from contactsense.multi_contact.joint_layout import (  # isort: skip
    EXTENT, FX, LOG_EVIDENCE, NX, OX, PX, R00, SX, TILT, TORSION, TX,
)  # fmt: skip

COMPONENT_WIDTH = 0.5
"""Standard deviation of a component over that of the stated distribution."""
_RADIUS = math.sqrt(2.0 * LANES / (LANES - 1.0) * (1.0 - COMPONENT_WIDTH**2))
_ANGLES = 2.0 * np.pi / (LANES - 1.0) * np.arange(LANES - 1)
COMPONENTS = np.vstack(((0.0, 0.0), _RADIUS * np.column_stack((np.cos(_ANGLES), np.sin(_ANGLES)))))
"""Middles of the components, which weigh the same, of a standard normal distribution in the plane; its
covariance is that of the mixture. Shape (LANES, 2)."""
DIVIDED = 3
"""Maximum number of explanations whose known places are divided; with six, regions hold as much
(`calibration-several --seed 11`), and the search takes longer."""
MIN_ODDS = 0.05
"""Explanations with smaller odds to the best one remain as they are."""
ROW = 0
"""Row of the candidates that is scratch."""


@fused_kernel
def divide_known_places(
    surface: PlacedSurface,
    prior: Prior,
    buffers: MultiContactBuffers,
    m: int,
    known: KnownRows,
    stored: int,
) -> None:
    """Correct the broad known places of the likely explanations.

    Args:
        surface, prior: Where contacts may be, and their prior. The candidates are scratch.
        buffers: The measurement, known contacts with free forces, and the explanations; of these, those
            behind the stored ones are scratch. The rows of the known contacts are changed.
        m: Number of rows of the measurement.
        known: Numbers of known contacts and of their rows, which are in `buffers.joint`.
        stored: Number of explanations.
    """
    rows, joint, explanations = buffers.rows, buffers.joint, buffers.explanations
    surfaces, limit = surface.surfaces, 2.0 * prior.surface_deviation
    bounded = _bound_normal_direction(surface, prior, buffers, known)
    kept = order_distinct(surfaces.link, explanations, 0, stored, limit, -math.log(MIN_ODDS))
    for a in range(min(kept, DIVIDED)):
        t = explanations.order[a]
        count = explanations.contacts[t]
        for i in range(known.contacts):
            C = buffers.known.covariance[i]
            if C[0, 0] + C[1, 1] + C[2, 2] < LINE_OF_ACTION_DEVIATION * LINE_OF_ACTION_DEVIATION:
                continue
            middle = vector_of(joint.known_mean[i], 0, 0)
            _place_components(surface, prior, buffers, t, i, bounded)
            _scale_rows(i, bounded, 1.0 / COMPONENT_WIDTH, joint)
            find_joint_modes(surfaces, rows, m, prior, bounded, count, LANES, math.inf, joint)
            fill_covariances(count, joint)
            highest = -math.inf
            for j in range(LANES):
                u = stored + j
                explanations.score[u] = -math.inf
                if joint.lane[LOG_EVIDENCE, j] > -math.inf:
                    store_explanation(joint, j, count, 0.0, explanations, u)
                    _condition_on_access(surface, prior, joint.contact[i], j, explanations, (u, i))
                    highest = max(highest, explanations.score[u])
            if highest > -math.inf:
                _take_mixture(explanations, t, i, stored, highest)
            _scale_rows(i, bounded, COMPONENT_WIDTH, joint)
            _state_middle(joint, i, middle)


@fused_kernel
def _bound_normal_direction(
    surface: PlacedSurface, prior: Prior, buffers: MultiContactBuffers, known: KnownRows
) -> KnownRows:
    """Add a row for each known contact: its place along the normal, as uncertain as along the surface."""
    joint, known_contacts = buffers.joint, buffers.known
    for i in range(known.contacts):
        point, force = vector(known_contacts.point[i]), vector(known_contacts.force[i])
        set_contact(surface, prior, joint, 0, i, known_contacts.primitive[i], point, force)
        n, C = vector_of(joint.contact[i], NX, 0), known_contacts.covariance[i]
        along_surface = C[0, 0] + C[1, 1] + C[2, 2] - bilinear_form(C, n, n)
        information = 1.0 / math.sqrt(max(0.5 * along_surface, 0.0) + MIN_POINT_DEVIATION**2)
        at = (known.rows + i) * KNOWN_NUMBERS * LANES
        for e in range(known.contacts):
            row = joint.known_rows[e]
            for q in range(at, at + KNOWN_NUMBERS * LANES):
                row[q] = 0.0
            for j in range(LANES):
                for k in range(3):
                    row[at + k * LANES + j] = information * n[k] if e == i else 0.0
    return KnownRows(known.contacts, known.rows + known.contacts)


@fused_kernel
def _place_components(
    surface: PlacedSurface, prior: Prior, buffers: MultiContactBuffers, t: int, i: int, known: KnownRows
) -> None:
    """Put explanation t into all lanes, with known contact i in the middle of another component in each."""
    joint, known_contacts, explanations = buffers.joint, buffers.known, buffers.explanations
    own, C = known_contacts.primitive[i], known_contacts.covariance[i]
    point, force = vector(known_contacts.point[i]), vector(explanations.force[t, i])
    set_contact(surface, prior, joint, 0, i, own, point, force)
    s, r = vector_of(joint.contact[i], SX, 0), vector_of(joint.contact[i], TX, 0)
    a = math.sqrt(bilinear_form(C, s, s) + MIN_POINT_DEVIATION**2)
    b = bilinear_form(C, s, r) / a
    d = math.sqrt(max(bilinear_form(C, r, r) - b * b, 0.0))
    for j in range(LANES):
        for c in range(explanations.contacts[t]):
            p, at = explanations.primitive[t, c], vector(explanations.point[t, c])
            if c == i:
                x, y = COMPONENTS[j, 0], COMPONENTS[j, 1]
                at = add_scaled(add_scaled(point, a * x, s), b * x + d * y, r)
                p = _nearest_primitive(surface, surface.surfaces.link[own], at)
            set_contact(surface, prior, joint, j, c, p, at, (0.0, 0.0, 0.0))
            block = joint.contact[c]
            push = pushing_force(vector(explanations.force[t, c]), vector_of(block, NX, j))
            for k in range(3):
                block[FX + k * LANES + j] = push[k]
            block[TORSION + j] = explanations.torsion[t, c]
            if c < known.contacts:
                block[EXTENT + j], block[TILT + j] = 0.0, 0.0
        for k in range(3):
            joint.known_mean[i, k * LANES + j] = joint.contact[i, PX + k * LANES + j]


@fused_kernel
def _nearest_primitive(surface: PlacedSurface, link: int, point: Vector) -> int:
    """The primitive of a link whose mean surface is nearest to a point [m]; inside several, the deepest."""
    surfaces, deviations, candidates = surface
    nearest, found = math.inf, 0
    for p in range(surfaces.start[link], surfaces.start[link + 1]):
        at = rotate_back(candidates.rotation[p], subtract(point, vector(candidates.origin[p])))
        distance = mean_surface_distance(surfaces, deviations, p, at)
        if distance < nearest:
            nearest, found = distance, p
    return found


@fused_kernel
def _scale_rows(i: int, known: KnownRows, factor: float, joint: JointState) -> None:
    """Scale what is known of the place of contact i."""
    for r in range(known.rows):
        at = r * KNOWN_NUMBERS * LANES
        for q in range(at, at + 3 * LANES):
            joint.known_rows[i, q] *= factor


@fused_kernel
def _state_middle(joint: JointState, i: int, point: Vector) -> None:
    """The middle of known place i, in all lanes."""
    for k in range(3):
        for j in range(LANES):
            joint.known_mean[i, k * LANES + j] = point[k]


@fused_kernel
def _condition_on_access(
    surface: PlacedSurface,
    prior: Prior,
    block: np.ndarray,
    lane: int,
    explanations: Explanations,
    which: tuple[int, int],
) -> None:
    """Condition a contact of an explanation on being accessible, and lower its score by the share that is.

    `block`, `lane`: with the body frame of its primitive. `which`: explanation and contact.
    """
    surfaces, deviations, candidates = surface
    t, i = which
    candidates.primitive[ROW], candidates.score[ROW] = explanations.primitive[t, i], 0.0
    R, o = candidates.mean_rotation, candidates.mean_origin
    point, normal, C = explanations.point[t, i], explanations.normal[t, i], explanations.covariance[t, i]
    for k in range(3):
        o[k] = block[OX + k * LANES + lane]
        candidates.point[ROW, k], candidates.normal[ROW, k] = point[k], normal[k]
        for b in range(3):
            R[k, b] = block[R00 + (3 * k + b) * LANES + lane]
            candidates.covariance[ROW, k, b] = C[k, b]
    apply_accessibility(surfaces, deviations, candidates, ROW, (R, o), prior, -math.inf)
    explanations.score[t] += candidates.score[ROW]
    for k in range(3):
        point[k], normal[k] = candidates.point[ROW, k], candidates.normal[ROW, k]
        for b in range(3):
            C[k, b] = candidates.covariance[ROW, k, b]


@fused_kernel
def _take_mixture(explanations: Explanations, t: int, i: int, first: int, highest: float) -> None:
    """Give contact i of explanation t the covariance of the mixture.

    `first`: row of the first component; `highest`: highest of their scores.
    """
    score, best, total, own = explanations.score, first, 0.0, 0.0
    for u in range(first, first + LANES):
        weight = math.exp(score[u] - highest)
        total += weight
        if weight > 0.0 and explanations.primitive[u, i] == explanations.primitive[t, i]:
            own += weight
        best = u if score[u] > score[best] else best
    if own < 0.5 * total:
        _copy_contacts(explanations, best, t)
    C, point = explanations.covariance[t, i], explanations.point[t, i]
    for k in range(3):
        for b in range(3):
            C[k, b] = 0.0
    for u in range(first, first + LANES):
        weight = math.exp(score[u] - highest) / total
        if weight > 0.0:
            away = subtract(vector(explanations.point[u, i]), vector(point))
            for k in range(3):
                for b in range(3):
                    C[k, b] += weight * (explanations.covariance[u, i, k, b] + away[k] * away[b])


@fused_kernel
def _copy_contacts(explanations: Explanations, u: int, t: int) -> None:
    """Copy the contacts of explanation u to t, but for their covariances."""
    for k in range(6):
        explanations.wrench[t, k] = explanations.wrench[u, k]
        for b in range(6):
            explanations.wrench_covariance[t, k, b] = explanations.wrench_covariance[u, k, b]
    for c in range(explanations.contacts[t]):
        explanations.primitive[t, c] = explanations.primitive[u, c]
        explanations.torsion[t, c] = explanations.torsion[u, c]
        for k in range(3):
            explanations.point[t, c, k] = explanations.point[u, c, k]
            explanations.normal[t, c, k] = explanations.normal[u, c, k]
            explanations.force[t, c, k] = explanations.force[u, c, k]
