"""The most probable contact and its wrench, each in one piece: Python copies a whole array at once, but takes
as long again to cut a part out of a larger one."""

from typing import Annotated, NamedTuple

import numpy as np

from contactsense.isolation.link_hypotheses import Hypotheses
from contactsense.robots.jit.declaration import Floats
from contactsense.robots.jit.kernel import kernel


class BestAnswer(NamedTuple):
    """The first of the rows of `contactsense.runtime.result_rows`, and the wrench that goes with it."""

    numbers: Annotated[Floats, "4"]
    """The row's `NUMBERS`."""
    vectors: Annotated[Floats, "7, 3"]
    """The row's `VECTORS`."""
    wrench: Annotated[Floats, "7, 6"]
    """External wrench for the link of the row, base axes, base origin [N, Nm]; then its covariance."""


@kernel
def store_best(count: int, rows: np.ndarray, hypotheses: Hypotheses, answer: BestAnswer) -> None:
    """Fill `answer` from the first of `count` rows; without one, only the wrench, for the link whose
    hypothesis fits best."""
    link = 0
    if count > 0:
        row = rows[0]
        link = int(row[0])
        for i in range(4):
            answer.numbers[i] = row[i]
        for k in range(7):
            for i in range(3):
                answer.vectors[k, i] = row[4 + 3 * k + i]
    else:
        for k in range(hypotheses.energy.shape[0]):
            if hypotheses.energy[k] < hypotheses.energy[link]:
                link = k
    for i in range(6):
        answer.wrench[0, i] = hypotheses.wrench[link, i]
        for k in range(6):
            answer.wrench[1 + i, k] = hypotheses.covariance[link, i, k]
