"""Where the places of a further contact are spread over a link."""

import numpy as np
import pytest

from contactsense.localization.candidate_buffers import Candidates
from contactsense.multi_contact.further_contact import SPREAD_DEVIATION, are_most_spread, is_any_broad
from contactsense.robots.jit.flat_buffers import zeros

NARROW, WIDE = 0.5 * SPREAD_DEVIATION, 2.0 * SPREAD_DEVIATION


@pytest.mark.parametrize(
    ("probability", "deviation", "expected"),
    [
        ([0.6, 0.4], [NARROW, WIDE], False),
        ([0.4, 0.6], [NARROW, WIDE], True),
        ([0.3, 0.3, 0.2, 0.2], [WIDE, NARROW, NARROW, WIDE], False),
        ([0.03, 0.02], [WIDE, NARROW], True),  # what is not listed does not count
        ([], [], False),
    ],
)
def test_most_of_the_probability_decides(
    probability: list[float], deviation: list[float], expected: bool
) -> None:
    count = len(probability)
    candidates = zeros(Candidates, candidates=max(count, 1), primitives=1)
    candidates.order[:count] = np.arange(count)[::-1]
    candidates.probability[:count] = probability
    candidates.covariance[:count] = np.square(deviation)[:, None, None] * np.diag([1.0, 0.0, 0.0])
    assert are_most_spread(candidates, count) == expected
    assert is_any_broad(candidates, count) == (count > 0)
