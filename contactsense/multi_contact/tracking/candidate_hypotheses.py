"""The candidates of a single contact as hypotheses, for the search of a further one."""

import math

from contactsense.multi_contact.tracking.multi_hypothesis_filter import MAX_HYPOTHESES, Hypothesis
from contactsense.multi_contact.tracking.tracked_contacts import tracked_contact
from contactsense.runtime.answer import COUNT
from contactsense.runtime.state import State
from contactsense.scene_model.constants import Constants

MIN_HYPOTHESIS_PROBABILITY = 0.1
"""Explanations of a single contact that are more probable than this are tested for a further one."""


def candidate_hypotheses(constants: Constants, state: State) -> list[Hypothesis]:
    """The candidates of the newest sample that are probable enough, most probable first: of the rows in
    `order`, the listed ones only; the others are of earlier samples, or part of one that is listed."""
    candidates = state.candidates
    count = min(int(state.answer.integers[COUNT]), MAX_HYPOTHESES - 1)
    hypotheses = []
    for row in candidates.order[:count].tolist():
        p = float(candidates.probability[row])
        if p < MIN_HYPOTHESIS_PROBABILITY:
            break
        contact = tracked_contact(
            constants,
            state.motion,
            int(candidates.primitive[row]),
            candidates.point[row],
            candidates.normal[row],
            candidates.covariance[row],
            candidates.force[row],
        )
        hypotheses.append(Hypothesis((contact,), math.log(p)))
    return hypotheses
