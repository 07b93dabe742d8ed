"""Whether the joint velocities of a recording are those with which its joint positions change.

The observers take what the motion needs for a contact where velocities are zero, of another unit or order, or
where the times are not in seconds. `contactsense.service.sensors.checks.velocity_check` judges single samples
of a live stream, this a file as a whole.
"""

from collections.abc import Sequence

import numpy as np

from contactsense.service.recordings.problems import Problem

WINDOW = 0.25
"""Movements over this time, at low rates a longer one, are compared with the integral of their velocities
[s]."""
FEWEST_STEPS = 4
"""Smallest number of steps between samples in a movement."""
MOST_STEPS = 1 << 16
"""Largest number: where times are not in seconds, no movement would be complete."""
LONGEST_STEP = 0.15
"""Velocities are not integrated over a longer time between two samples [s]."""
MOVED = 0.02
"""Smaller movements show nothing [rad]."""
WRONG = 0.5
"""A movement contradicts the integral of its velocity if they differ by more than this share of the larger.
In the recordings of a real UR10e in docs/analysis.md none of them does."""
SHARE = 0.1
"""A joint is reported if more of its movements contradict its velocity."""
MOVEMENTS = 4
"""Smallest number of movements that is needed to decide."""


class VelocityAgreement:
    """Counts, block by block, the movements of each joint that contradict its velocity.

    Args:
        joints: Names of the joints.
    """

    def __init__(self, joints: Sequence[str]) -> None:
        n = len(joints)
        self._joints = joints
        self._movements, self._wrong = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
        # Samples of the movement that is not complete yet.
        self._rest = np.empty(0), np.empty((0, n)), np.empty((0, n))

    def add(self, t: np.ndarray, q: np.ndarray, qd: np.ndarray) -> None:
        """Take in one block.

        Args:
            t: Times of the samples, shape (N,) [s].
            q, qd: Joint positions and velocities, shape (N, n) [rad, rad/s].
        """
        t, q, qd = (
            np.concatenate(parts) if len(parts[0]) else parts[1]
            for parts in zip(self._rest, (t, q, qd), strict=True)
        )
        step = np.diff(t)
        usual = step[(step > 0.0) & (step <= LONGEST_STEP)]
        steps = WINDOW / float(np.median(usual)) if len(usual) else 0.0
        steps = min(max(round(steps), FEWEST_STEPS), MOST_STEPS)
        ends = np.arange(0, len(t), steps)
        last = int(ends[-1]) if len(ends) else 0
        self._rest = t[last:], q[last:], qd[last:]
        if last == 0:
            return
        step = step[:last]
        change = np.diff(q[: last + 1], axis=0)
        turns = np.abs(change) > np.pi  # a joint that turns on and on is counted from -pi again
        change[turns] -= 2.0 * np.pi * np.round(change[turns] / (2.0 * np.pi))
        integral = 0.5 * (qd[:last] + qd[1 : last + 1]) * step[:, None]
        moved, integrated = (np.add.reduceat(x, ends[:-1]) for x in (change, integral))
        usable = np.logical_and.reduceat((step > 0.0) & (step <= LONGEST_STEP), ends[:-1])
        largest = np.maximum(np.abs(moved), np.abs(integrated))
        moves = usable[:, None] & (largest > MOVED)  # not where a number is missing
        self._movements += moves.sum(axis=0)
        self._wrong += (moves & (np.abs(moved - integrated) > WRONG * largest)).sum(axis=0)

    def problems(self, rows: int) -> list[Problem]:
        """What is reported of a file with this number of rows."""
        share = self._wrong / np.maximum(self._movements, 1)
        found = np.flatnonzero((self._movements >= MOVEMENTS) & (share > SHARE))
        if not len(found):
            return []
        worst = float(share[found].max())
        names = ", ".join(self._joints[j] for j in found.tolist())
        message = (
            "qd: expected the velocities [rad/s] with which q changes, got others in up to "
            f"{worst:.0%} of the movements of {names}: what the motion needs looks like contacts; are they "
            "zero, of another unit or order, or are the times not in seconds?"
        )
        return [Problem(0, rows, "velocities", message, worst)]
