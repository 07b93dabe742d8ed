"""Steps of the search for several contacts that tests call one by one, compiled as one kernel.

A kernel that Python calls is compiled with all that it calls and with code that converts its arguments.
Called one by one, most steps would compile the joint optimization anew, and the conversion of a hundred
arrays.
"""

import math
from dataclasses import dataclass

from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.multi_contact.explanations.set_evidence import known_evidence
from contactsense.multi_contact.joint.joint_energy import linearize
from contactsense.multi_contact.joint.joint_optimization import find_joint_modes, take_rows
from contactsense.multi_contact.joint.joint_problem import JointProblem
from contactsense.multi_contact.joint.known_rows import Known, KnownRows
from contactsense.multi_contact.known_contacts.known_components import fill_component_priors
from contactsense.multi_contact.known_contacts.known_place_mixture import divide_known_places
from contactsense.multi_contact.known_contacts.known_prior import fill_known_prior
from contactsense.multi_contact.memory.buffers import MultiContactBuffers
from contactsense.robots.jit.kernel import fused_kernel

LINEARIZE, OPTIMIZE, KNOWN_PRIOR, KNOWN_EVIDENCE, COMPONENT_PRIORS, DIVIDE = range(6)
NONE_KNOWN = Known(0, math.inf, measured=False)


@fused_kernel
def _take(
    step: int,
    surface: PlacedSurface,
    problem: JointProblem,
    known: Known,
    buffers: MultiContactBuffers,
    number: int,
    limit: float,
) -> tuple[KnownRows, float]:
    """Take one step; returns the rows of the known contacts that it fills, and the evidence that it finds.

    `number`: of lanes, of the contact that is divided, or of stored explanations.
    """
    joint, prior, measurement = buffers.joint, problem.prior, problem.measurement
    rows, evidence = problem.known, 0.0
    if step == LINEARIZE:
        take_rows(problem, joint)
        linearize(problem, joint)
    elif step == OPTIMIZE:
        find_joint_modes(problem, number, limit, joint)
    elif step == KNOWN_PRIOR:
        rows = fill_known_prior(surface, prior, measurement, buffers.known, known, joint, buffers.known_prior)
    elif step == KNOWN_EVIDENCE:
        evidence = known_evidence(problem, joint)
    elif step == COMPONENT_PRIORS:
        rows = fill_component_priors(surface, prior, buffers, measurement, known, number)
    elif step == DIVIDE:
        divide_known_places(surface, prior, buffers, measurement, known, number)
    return rows, evidence


@dataclass(frozen=True)
class JointSteps:
    """The functions of these names, with the arrays of one arm in one posture. Of a problem, the steps that
    fill what is known use measurement and prior only."""

    surface: PlacedSurface
    buffers: MultiContactBuffers

    def linearize(self, problem: JointProblem) -> None:
        """After `take_rows`."""
        self._take(LINEARIZE, problem)

    def find_joint_modes(self, problem: JointProblem, lanes: int, limit: float = math.inf) -> None:
        self._take(OPTIMIZE, problem, number=lanes, limit=limit)

    def fill_known_prior(self, problem: JointProblem, known: Known) -> KnownRows:
        return self._take(KNOWN_PRIOR, problem, known)[0]

    def known_evidence(self, problem: JointProblem) -> float:
        return self._take(KNOWN_EVIDENCE, problem)[1]

    def fill_component_priors(self, problem: JointProblem, known: Known, i: int) -> KnownRows:
        return self._take(COMPONENT_PRIORS, problem, known, i)[0]

    def divide_known_places(self, problem: JointProblem, known: Known, stored: int) -> None:
        self._take(DIVIDE, problem, known, stored)

    def _take(
        self,
        step: int,
        problem: JointProblem,
        known: Known = NONE_KNOWN,
        number: int = 0,
        limit: float = math.inf,
    ) -> tuple[KnownRows, float]:
        return _take(step, self.surface, problem, known, self.buffers, number, limit)
