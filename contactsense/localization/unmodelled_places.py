"""A touch at a place that the primitives do not model, such as a pocket, a rib or the flank of a step.

The real normal there is that of no primitive near it, so the force may be tangential to the primitives or
pull on them, and the contact is not found. If its line of action enters a primitive elsewhere, that place
would explain the measurement with certainty. So such a touch is a hypothesis of its own on each link. Its
prior probability follows from the tilt of the real surface (`contactsense.scene_model.unmodelled_places`),
its evidence from where on the link these places are (`contactsense.localization.surface.surface_moments`).
"""

import math

from contactsense.localization.problem.searched_surface import SearchArrays
from contactsense.localization.problem.single_contact_problem import SingleContactProblem
from contactsense.localization.surface.surface_moments import evidence_of_touch
from contactsense.localization.unmodelled_candidates import add_unmodelled_candidates
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.vectors import dot
from contactsense.solvers.posterior.mode import ENERGY_CUTOFF

NEGLIGIBLE_MARGIN = 14.0
"""These touches are negligible beside a contact whose log evidence is better than that of "none of these" by
this much: without this margin the stated probability of a contact changes by at most 4 %, and by more than
1 % for one of 2000 contacts."""
LEAST_PROBABILITY = 0.01
"""Touches that are less probable than this, relative to the best candidate, get no candidates."""


@fused_kernel
def add_unmodelled_places(
    problem: SingleContactProblem,
    arrays: SearchArrays,
    none_evidence: float,
    best: float,
    count: int,
) -> int:
    """Add candidates at unmodelled places to those that are found, for a known line of action.

    Args:
        problem: The measurement, and where the contact may be.
        arrays: With the candidates. What no candidate has is written to `cells.unassigned_evidence`.
        none_evidence: Log evidence of "none of these".
        best: Best log evidence of the candidates.
        count: Number of candidates.

    Returns:
        Number of candidates with those added.
    """
    if best >= none_evidence + NEGLIGIBLE_MARGIN:
        return count
    scene, searched, motion, hypotheses, _, prior = problem
    depth, unassigned = scene.depth, arrays.cells.unassigned_evidence
    best = max(best, none_evidence)
    for link in range(depth.shape[0]):
        # The likelihood of a touch on a link is at most exp(-energy) of that link.
        bound = scene.unmodelled.log_weight[link] - hypotheses.energy[link]
        if searched[link] == 0 or not bound >= best - ENERGY_CUTOFF:
            continue
        w = hypotheses.wrench[link]
        force = (w[0], w[1], w[2])
        if not dot(force, force) > 0.0:
            continue
        R, o = motion.rotation[depth[link]], motion.origin[depth[link]]
        unassigned[link] = evidence_of_touch(
            scene.unmodelled, link, R, o, force, hypotheses, prior, arrays.buffers
        )
        least = best + math.log(LEAST_PROBABILITY)
        if unassigned[link] > least:
            count = add_unmodelled_candidates(problem, arrays, link, least, count)
    return count
