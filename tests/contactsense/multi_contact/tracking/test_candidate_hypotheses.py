"""What the search of a further contact takes over from a single one."""

import math

import numpy as np
import pytest

from contactsense import Scene
from contactsense.multi_contact.tracking.candidate_hypotheses import candidate_hypotheses
from contactsense.runtime.answer import COUNT
from contactsense.runtime.state import State, empty_state
from contactsense.scene_model.constants import build_constants

pytestmark = pytest.mark.slow  # its kernels compile for long

CONSTANTS = build_constants(Scene(robot="ur5e"))


@pytest.fixture
def state() -> State:
    """Five candidates, of which the newest sample has listed none yet."""
    state = empty_state(CONSTANTS)
    candidates = state.candidates
    candidates.order[:5] = 4, 2, 0, 1, 3
    candidates.primitive[:5] = 3, 3, 8, 8, 15
    candidates.probability[[4, 2, 0, 1, 3]] = 0.4, 0.3, 0.15, 0.12, 0.03
    candidates.point[:5] = 0.01 * np.arange(5)[:, None]
    candidates.normal[:5], candidates.force[:5] = (0.0, 0.0, 1.0), (0.0, 0.0, -10.0)
    candidates.covariance[:5] = 1e-6 * np.eye(3)
    return state


@pytest.mark.parametrize(
    ("listed", "expected"), [(0, []), (1, [0.4]), (2, [0.4, 0.3]), (5, [0.4, 0.3, 0.15])]
)
def test_only_listed_candidates_are_hypotheses(state: State, listed: int, expected: list[float]) -> None:
    # The rows after them are those of an earlier sample, or what a listed one has absorbed.
    state.answer.integers[COUNT] = listed
    found = candidate_hypotheses(CONSTANTS, state)
    assert [math.exp(h.log_probability) for h in found] == pytest.approx(expected)


def test_improbable_candidates_are_no_hypotheses(state: State) -> None:
    state.candidates.probability[2] = 0.05
    state.answer.integers[COUNT] = 3
    assert len(candidate_hypotheses(CONSTANTS, state)) == 1
