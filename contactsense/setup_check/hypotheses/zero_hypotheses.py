"""Joint positions counted from another zero than the arm's: a joint that was homed wrongly, or a description
of the arm with other zeros."""

import numpy as np

from contactsense.setup_check.hypotheses.hypothesis import Hypothesis
from contactsense.setup_check.lines import ZEROS
from contactsense.setup_check.setup import Free, Setup

_QUARTERS = (0.0, 0.5 * np.pi, -0.5 * np.pi, np.pi)
"""Zeros of other conventions differ by quarter turns [rad]."""


def angle_zeros(setup: Setup) -> list[Hypothesis]:
    """Other zeros of one joint or of several.

    Not of the first and the last: gravity and a base sensor turned about the first axis, and a tool turned
    about the last one, have the same readings, and are lines of the scene.
    """
    groups = tuple(Free("zero", joint=joint) for joint in range(1, len(setup.angle_zero) - 1))
    if not groups:
        return []
    found = [Hypothesis(ZEROS, (("", setup),), groups)]
    for group in groups:
        starts = tuple(("", setup.moved((group,), np.array([angle]))) for angle in _QUARTERS)
        found.append(Hypothesis(ZEROS, starts, (group,), special=True))
    return found
