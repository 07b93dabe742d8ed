"""Evidence of a set of contacts: its joint optimum, the prior of each further contact, and accessibility."""

import math

from contactsense.localization.accessibility import accessible_share, clearance, is_mounting_face
from contactsense.multi_contact.buffers import MeasurementRows, OptimizerState, PrimitiveFrames
from contactsense.multi_contact.joint_optimization import find_joint_mode
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.solvers.posterior import STUDENT_DOF, Prior

FURTHER_CONTACT_ODDS = 0.02
"""Prior odds of one more contact."""


@fused_kernel
def known_evidence(
    surfaces: Surfaces,
    prior: Prior,
    frames: PrimitiveFrames,
    rows: MeasurementRows,
    known_count: int,
    optimizer: OptimizerState,
) -> float:
    """Log evidence of the known contacts before the measurement.

    The optimization uses the same priors for every contact: of its link and place, and of its force.
    The priors of known contacts are additional factors exp(-d^2 / 2) and not normalized. Subtracting this
    log evidence normalizes them, so that explanations with different known contacts are comparable.
    """
    if known_count == 0:
        return 0.0
    _, score = find_joint_mode(surfaces, frames, rows, 0, prior, known_count, math.inf, optimizer)
    if score == -math.inf:
        return 0.0
    for i in range(known_count):
        if optimizer.prior_force_information[i] == 0.0:
            # Without a prior of the force, correct Laplace's approximation for the tail of Student's t.
            score += math.log(1.0 + 2.0 / STUDENT_DOF)
    return float(score)


@fused_kernel
def set_evidence(
    surfaces: Surfaces,
    prior: Prior,
    frames: PrimitiveFrames,
    rows: MeasurementRows,
    m: int,
    known_count: int,
    count: int,
    limit: float,
    optimizer: OptimizerState,
) -> tuple[float, float]:
    """Optimize the contacts in `optimizer`, the known ones first.

    Arguments as for `contactsense.multi_contact.joint_optimization.find_joint_mode`.

    Returns:
        Energy, and log evidence with the priors of the further contacts.
    """
    energy, score = find_joint_mode(surfaces, frames, rows, m, prior, count, limit, optimizer)
    if energy < math.inf:
        score += (count - known_count) * math.log(FURTHER_CONTACT_ODDS)
        score += _log_accessibility(surfaces, frames, prior, optimizer, known_count, count)
    return energy, score


@fused_kernel
def _log_accessibility(
    surfaces: Surfaces,
    frames: PrimitiveFrames,
    prior: Prior,
    optimizer: OptimizerState,
    known_count: int,
    count: int,
) -> float:
    """Log of the accessible share of the further contacts."""
    score = 0.0
    for i in range(known_count, count):
        c, p, T = optimizer.point[i], optimizer.primitive[i], optimizer.frame[i]
        if is_mounting_face(surfaces.link[p], c[2], T[2, 0], prior.surface_deviation):
            return -math.inf
        height = prior.clearance
        x, y, z = c[0] + height * T[0, 0], c[1] + height * T[1, 0], c[2] + height * T[2, 0]
        score += math.log(accessible_share(clearance(surfaces, frames, p, x, y, z, 0.0), prior))
    return score
