"""Sensors whose values a recording holds: each new value is repeated until the next one comes.

Whoever resamples a slow signal to the rate of a fast one may not notice. Noise that is held does not average
out: the observers take it for a contact.
"""

from collections import Counter

import numpy as np

from contactsense.service.recordings.problems import Problem

MOVING = 0.01
"""An arm with a joint faster than this moves, and its readings change even without noise [rad/s]."""
SHARE = 0.1
"""A sensor that repeats its values in more of the rows is reported."""
ROWS = 100
"""Smallest number of rows in motion that is needed to decide."""


class HeldValues:
    """Counts, block by block, how often each sensor repeats all its values while the arm moves."""

    def __init__(self) -> None:
        self._moving: Counter[str] = Counter()
        self._repeated: Counter[str] = Counter()

    def add(self, field: str, values: np.ndarray, qd: np.ndarray) -> None:
        """Take in one block of a sensor.

        Args:
            field: Name of the sensor.
            values: Its values as recorded, shape (N, k).
            qd: Joint velocities, shape (N, n) [rad/s].
        """
        moving = np.abs(qd[1:]).max(axis=1, initial=0.0) > MOVING
        self._moving[field] += int(moving.sum())
        self._repeated[field] += int((moving & (values[1:] == values[:-1]).all(axis=1)).sum())

    def problems(self, rows: int) -> list[Problem]:
        """One for each sensor that repeats its values too often; `rows`: number of rows of the file."""
        found = []
        for field, moving in self._moving.items():
            share = self._repeated[field] / max(moving, 1)
            if moving >= ROWS and share > SHARE:
                message = (
                    f"{field} repeats its values in {share:.0%} of the rows in which the arm moves: held "
                    "values look like contacts; expected a new value in each row, keep only rows with one"
                )
                found.append(Problem(0, rows, "held", message, share))
        return found
