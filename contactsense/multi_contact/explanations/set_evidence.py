"""Evidence of a set of contacts: its joint optimum, the prior of each further contact, and accessibility."""

import math

from contactsense.localization.candidates.accessibility import accessible_share, clearance, is_mounting_face
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.multi_contact.joint.contact_step import vector_of
from contactsense.multi_contact.joint.joint_optimization import find_joint_modes
from contactsense.multi_contact.joint.joint_problem import JointProblem
from contactsense.multi_contact.memory.buffers import UNKNOWNS, JointState, Measurement
from contactsense.multi_contact.memory.joint_layout import ENERGY, LOG_EVIDENCE, NX, PX
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.solvers.posterior.contact_prior import STUDENT_DOF, Prior

FURTHER_CONTACT_ODDS = 0.02
"""Prior odds of one more contact."""


@fused_kernel
def known_evidence(problem: JointProblem, joint: JointState) -> float:
    """Log evidence of the known contacts before the measurement, which are in lane 0; further contacts of the
    problem do not count.

    The optimization uses the same priors for every contact: of its link and place, and of its force as far
    as it is a new one. What is known of it is an additional factor exp(-d^2 / 2) and not normalized.
    Subtracting this log evidence normalizes it, so that explanations with different known contacts are
    comparable.
    """
    surfaces, prior, (rows, _), known, _ = problem
    if known.contacts == 0:
        return 0.0
    alone = JointProblem(surfaces, prior, Measurement(rows, 0), known, known.contacts)
    find_joint_modes(alone, 1, math.inf, joint)
    score = joint.lane[LOG_EVIDENCE, 0]
    if score == -math.inf:
        return 0.0
    if known.rows < UNKNOWNS * known.contacts:
        # The forces are new ones: correct Laplace's approximation for the tail of Student's t.
        score += known.contacts * math.log(1.0 + 2.0 / STUDENT_DOF)
    return float(score)


@fused_kernel
def fill_set_evidence(problem: JointProblem, lanes: int, limit: float, joint: JointState) -> None:
    """Optimize the contacts in `joint`, the known ones first; `LOG_EVIDENCE` is that with the prior odds of
    the further contacts.

    Arguments as for `contactsense.multi_contact.joint.joint_optimization.find_joint_modes`.
    """
    further = problem.contacts - problem.known.contacts
    find_joint_modes(problem, lanes, limit, joint)
    for j in range(lanes):
        if joint.lane[ENERGY, j] < math.inf:
            joint.lane[LOG_EVIDENCE, j] += further * math.log(FURTHER_CONTACT_ODDS)


@fused_kernel
def add_accessibility(
    surface: PlacedSurface,
    prior: Prior,
    known_count: int,
    count: int,
    lanes: int,
    joint: JointState,
) -> None:
    """Add to `LOG_EVIDENCE` how far the further contacts are accessible.

    Args:
        surface: Where contacts may be.
        prior, known_count, count, lanes, joint: After `fill_set_evidence`.
    """
    for j in range(lanes):
        if joint.lane[ENERGY, j] < math.inf:
            for i in range(known_count, count):
                joint.lane[LOG_EVIDENCE, j] += _log_accessibility(surface, prior, joint, j, i)


@fused_kernel
def _log_accessibility(
    surface: PlacedSurface,
    prior: Prior,
    joint: JointState,
    j: int,
    i: int,
) -> float:
    """Log of the accessible share of contact i of lane j."""
    c, n, p = vector_of(joint.contact[i], PX, j), vector_of(joint.contact[i], NX, j), joint.primitive[i, j]
    if is_mounting_face(surface.surfaces.link[p], c[2], n[2], prior.surface_deviation):
        return -math.inf
    free = clearance(surface, p, c, n, prior.clearance, 0.0)
    return math.log(accessible_share(free, prior))
