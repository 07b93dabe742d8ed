"""Places of known contacts, where a normal distribution on one primitive does not describe them.

A known place is one normal distribution in the tangent plane of one primitive. If it is broad, the place may
be beyond an edge, on the next primitive, or on the far side of the link; and what a measurement leaves of it
is no normal distribution about the optimum: at a rounded edge the normal turns so fast that friction makes
the optimum a narrow one, while most of the probability is on the plane beside it.

So the stated distribution is divided into a mixture of narrower ones
(`contactsense.multi_contact.known_contacts.known_components`; Gaussian sum: Alspach & Sorenson 1972,
Nonlinear Bayesian estimation using Gaussian sum approximations). The joint optimization is repeated with
each, one in each lane. Nothing within another primitive can be touched, so that the weight of a component is
the evidence of its accessible share. Along its normal a component remains as wide as stated, since the search
moves a contact along the surface only. The covariance of the place becomes the mean squared distance of the
mixture from the optimum. If most of the mixture is on other primitives, the explanation becomes that of its
best component. Between explanations, the evidence remains that of the optimum.
"""

import math

import numpy as np

from contactsense.localization.candidates.accessibility import apply_accessibility
from contactsense.localization.line_accuracy import LINE_OF_ACTION_DEVIATION
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.localization.surface.primitive_frames import Frame
from contactsense.multi_contact.explanations.pooled_places import bilinear_form
from contactsense.multi_contact.explanations.ranked_sets import order_distinct
from contactsense.multi_contact.explanations.stored_explanations import store_explanation
from contactsense.multi_contact.joint.contact_step import set_contact, vector_of
from contactsense.multi_contact.joint.initial_contacts import initialize_known_contact, weigh_priors
from contactsense.multi_contact.joint.joint_covariance import fill_covariances
from contactsense.multi_contact.joint.joint_optimization import find_joint_modes
from contactsense.multi_contact.joint.joint_problem import JointProblem
from contactsense.multi_contact.joint.known_rows import Known
from contactsense.multi_contact.known_contacts.known_components import COMPONENT_WIDTH, fill_component_priors
from contactsense.multi_contact.memory.buffers import Explanations, Measurement, MultiContactBuffers
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.vectors import Vector, dot, subtract, vector
from contactsense.solvers.posterior.contact_prior import Prior, pushing_force

from contactsense.multi_contact.memory.joint_layout import (  # isort: skip
    EXTENT, FORCE_PRIOR, FX, LOG_EVIDENCE, NX, OX, R00, TILT, TORSION,
)  # fmt: skip

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
    measurement: Measurement,
    known: Known,
    stored: int,
) -> None:
    """Correct the broad known places of the likely explanations.

    Args:
        surface, prior: Where contacts may be, and their prior.
        buffers: The known contacts and the explanations; of these, those behind the stored
            ones are scratch, as are the candidates. The rows of the known contacts are scratch, too.
        measurement: The measurement.
        known: Their number, and what has changed since they were estimated.
        stored: Number of explanations.
    """
    joint, explanations = buffers.joint, buffers.explanations
    surfaces, limit = surface.surfaces, 2.0 * prior.surface_deviation
    kept = order_distinct(surfaces.link, explanations, 0, stored, limit, -math.log(MIN_ODDS))
    for i in range(known.contacts):
        initialize_known_contact(surface, prior, buffers.known, joint, known, prior.force, 0, i)
        normal = vector_of(joint.contact[i], NX, 0)
        if not _is_broad(buffers.known.covariance[i], normal, joint.contact[i, FORCE_PRIOR]):
            continue
        known_rows = fill_component_priors(surface, prior, buffers, measurement, known, i)
        for a in range(min(kept, DIVIDED)):
            t = explanations.order[a]
            count = explanations.contacts[t]
            _start_at_components(surface, prior, buffers, t, i, known)
            problem = JointProblem(surfaces, prior, measurement, known_rows, count)
            find_joint_modes(problem, LANES, math.inf, joint)
            fill_covariances(count, joint)
            highest = _store_components(surface, prior, buffers, (i, count), normal, stored)
            if highest > -math.inf:
                _take_mixture(explanations, t, i, stored, highest)


@fused_kernel
def _is_broad(C: np.ndarray, normal: Vector, friction_share: float) -> bool:
    """Whether a known place with that covariance [m^2] is too broad for one normal distribution.

    `friction_share`: how much the friction counts again. While it hardly does, as with a held force, it does
    not tell where along the surface the place is; what then matters is how far that is off the tangent plane.
    """
    along_normal = bilinear_form(C, normal, normal)
    along_surface = C[0, 0] + C[1, 1] + C[2, 2] - along_normal
    variance = along_normal + friction_share * along_surface
    return bool(variance > LINE_OF_ACTION_DEVIATION * LINE_OF_ACTION_DEVIATION)


@fused_kernel
def _start_at_components(
    surface: PlacedSurface,
    prior: Prior,
    buffers: MultiContactBuffers,
    t: int,
    i: int,
    known: Known,
) -> None:
    """Put explanation t into all lanes, with known contact i in the middle of another component in each."""
    joint, explanations = buffers.joint, buffers.explanations
    for j in range(LANES):
        for c in range(explanations.contacts[t]):
            p, at = explanations.primitive[t, c], vector(explanations.point[t, c])
            force, torsion = vector(explanations.force[t, c]), explanations.torsion[t, c]
            if c == i:
                mean = joint.known_mean[c]
                p, at = buffers.known_prior.primitive[j], vector_of(mean, 0, j)
                if known.drift < math.inf:
                    force, torsion = vector_of(mean, 3 * LANES, j), mean[6 * LANES + j]
            set_contact(surface, prior, joint, j, c, p, at, (0.0, 0.0, 0.0))
            block = joint.contact[c]
            push = pushing_force(force, vector_of(block, NX, j))
            for k in range(3):
                block[FX + k * LANES + j] = push[k]
            block[TORSION + j] = torsion
            if c < known.contacts:
                block[EXTENT + j], block[TILT + j] = 0.0, 0.0
                weigh_priors(known, j, block)


@fused_kernel
def _store_components(
    surface: PlacedSurface,
    prior: Prior,
    buffers: MultiContactBuffers,
    counts: tuple[int, int],
    normal: Vector,
    stored: int,
) -> float:
    """Store the lanes as explanations behind the `stored` ones; returns the highest of their scores.

    `counts`: which known contact is divided, and the number of contacts. `normal`: that of its stated place.
    """
    joint, explanations = buffers.joint, buffers.explanations
    before, (i, count), highest = buffers.known_prior.evidence, counts, -math.inf
    depth = COMPONENT_WIDTH**2 * bilinear_form(buffers.known.covariance[i], normal, normal)
    for j in range(LANES):
        u = stored + j
        explanations.score[u] = -math.inf
        if joint.lane[LOG_EVIDENCE, j] > -math.inf and before[j] > -math.inf:
            store_explanation(joint, j, count, before[j], explanations, u)
            _condition_on_access(surface, prior, joint.contact[i], j, buffers, (u, i))
            _add_depth(explanations.normal[u, i], normal, depth, explanations.covariance[u, i])
            highest = max(highest, explanations.score[u])
    return highest


@fused_kernel
def _add_depth(normal: np.ndarray, stated: Vector, depth: float, C: np.ndarray) -> None:
    """Raise the variance of a place along its normal to what a component has of it.

    `stated`, `depth`: normal at the stated place, and variance of the component along it [m^2].
    """
    n = vector(normal)
    missing = max(depth * dot(n, stated) ** 2 - bilinear_form(C, n, n), 0.0)
    for k in range(3):
        for b in range(3):
            C[k, b] += missing * n[k] * n[b]


@fused_kernel
def _condition_on_access(
    surface: PlacedSurface,
    prior: Prior,
    block: np.ndarray,
    lane: int,
    buffers: MultiContactBuffers,
    which: tuple[int, int],
) -> None:
    """Condition a contact of an explanation on being accessible, and lower its score by the share that is.

    `block`, `lane`: with the body frame of its primitive. `which`: explanation and contact.
    """
    candidates, explanations, (t, i) = buffers.candidates, buffers.explanations, which
    candidates.primitive[ROW], candidates.score[ROW] = explanations.primitive[t, i], 0.0
    frame = Frame(surface.frames.mean_rotation, surface.frames.mean_origin)
    R, o = frame
    point, normal, C = explanations.point[t, i], explanations.normal[t, i], explanations.covariance[t, i]
    for k in range(3):
        o[k] = block[OX + k * LANES + lane]
        candidates.point[ROW, k], candidates.normal[ROW, k] = point[k], normal[k]
        candidates.force[ROW, k] = explanations.force[t, i, k]
        for b in range(3):
            R[k, b] = block[R00 + (3 * k + b) * LANES + lane]
            candidates.covariance[ROW, k, b] = C[k, b]
    apply_accessibility(surface, candidates, ROW, frame, prior, -math.inf)
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
