"""The newest answer of a kernel that Python calls for one sample, as Python needs it: Python copies a whole
array at once, but takes as long again to cut a part out of a larger one."""

from typing import Annotated, NamedTuple

import numpy as np

from contactsense.isolation.link_hypotheses import Hypotheses
from contactsense.localization.candidates.candidate_buffers import MAX_CANDIDATES
from contactsense.robots.jit.declaration import Floats, Integers
from contactsense.robots.jit.kernel import kernel
from contactsense.runtime.result_rows import FIRST_POINT, PROBABILITY, TORSION, WIDTH
from contactsense.runtime.result_rows import LINK as LINK_COLUMN
from contactsense.runtime.result_rows import PRIMITIVE as PRIMITIVE_COLUMN

COUNT, LINK, PRIMITIVE, PHASE, NUMBER, SENSORS = range(6)
"""Indices of `Answer.integers`: number of candidates; link and primitive (among the link's own) of the first.
For a stream also phase and number of its contact, and which residuals were usable, see
`contactsense.sensors.usable_sensors.usable_residuals_code`."""


class Answer(NamedTuple):
    """The candidates, and of the first one everything that an estimate reports, each in one piece."""

    rows: Annotated[Floats, f"max(primitives, {MAX_CANDIDATES}), {WIDTH}"]
    """All candidates, see `contactsense.runtime.result_rows`."""
    integers: Annotated[Integers, "6"]
    """See `COUNT`."""
    numbers: Annotated[Floats, "3"]
    """Probability of the first candidate; its torsion [Nm]; probability of no candidate."""
    vectors: Annotated[Floats, "7, 3"]
    """Its `contactsense.runtime.result_rows.VECTORS`."""
    wrench: Annotated[Floats, "6"]
    """External wrench for its link, base axes, base origin [N, Nm]."""
    covariance: Annotated[Floats, "6, 6"]
    """Covariance of the wrench."""


@kernel
def store_first(
    count: int, rows: np.ndarray, hypotheses: Hypotheses, first_primitive: np.ndarray, answer: Answer
) -> None:
    """Fill `answer` from the first of `count` rows; without one, only the wrench, for the link whose
    hypothesis fits best.

    Args:
        count: Number of candidates.
        rows: The candidates.
        hypotheses: Wrench for each link.
        first_primitive: Index of each link's first primitive.
        answer: Filled, apart from `rows` and what only a stream has.
    """
    link = 0
    if count > 0:
        row = rows[0]
        link = int(row[LINK_COLUMN])
        answer.integers[LINK] = link
        answer.integers[PRIMITIVE] = int(row[PRIMITIVE_COLUMN]) - first_primitive[link]
        other = 1.0
        for k in range(count):
            other -= rows[k, PROBABILITY]
        answer.numbers[0], answer.numbers[1], answer.numbers[2] = row[PROBABILITY], row[TORSION], other
        for k in range(7):
            for i in range(3):
                answer.vectors[k, i] = row[FIRST_POINT + 3 * k + i]
    else:
        for k in range(hypotheses.energy.shape[0]):
            if hypotheses.energy[k] < hypotheses.energy[link]:
                link = k
    answer.integers[COUNT] = count
    for i in range(6):
        answer.wrench[i] = hypotheses.wrench[link, i]
        for k in range(6):
            answer.covariance[i, k] = hypotheses.covariance[link, i, k]
