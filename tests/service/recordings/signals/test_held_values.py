"""A sensor whose values are held is told from one of an arm at rest, and not from a few rows."""

import numpy as np
import pytest

from contactsense.service.recordings.signals.held_values import MOVING, ROWS, SHARE, HeldValues


def held(rows: int, repeat: int, speed: float) -> bool:
    """Whether it is told of an arm that moves at a speed, whose readings are there so many times each."""
    values = np.repeat(np.random.default_rng(1).standard_normal((rows, 6)), repeat, axis=0)[: rows + 1]
    found = HeldValues()
    found.add("base_wrench", values, np.full((rows + 1, 6), speed))
    return bool(found.problems(rows + 1))


@pytest.mark.parametrize(("rows", "told"), [(ROWS - 1, False), (ROWS, True)])
def test_some_rows_in_motion_are_needed(rows: int, told: bool) -> None:
    assert held(rows, 4, 2.0 * MOVING) == told


def test_an_arm_at_rest_may_repeat_its_readings() -> None:
    assert not held(10 * ROWS, 4, 0.5 * MOVING)
    # Nor do its rows count beside those in motion.
    both = HeldValues()
    fresh = np.random.default_rng(2).standard_normal((2 * ROWS, 6))
    both.add("base_wrench", fresh, np.full((2 * ROWS, 6), 2.0 * MOVING))
    both.add("base_wrench", np.zeros((10 * ROWS, 6)), np.zeros((10 * ROWS, 6)))
    assert not both.problems(12 * ROWS)


@pytest.mark.parametrize(("share", "told"), [(0.8 * SHARE, False), (1.2 * SHARE, True)])
def test_what_is_repeated_now_and_then_is_not_held(share: float, told: bool) -> None:
    rows = 10 * ROWS
    values = np.random.default_rng(3).standard_normal((rows + 1, 6))
    again = np.arange(1, rows + 1, round(1.0 / share))
    values[again] = values[again - 1]
    found = HeldValues()
    found.add("base_wrench", values, np.ones((rows + 1, 6)))
    assert bool(found.problems(rows + 1)) == told
