"""Whether a robot's joint velocities are those with which its joint positions change.

The observers take what the arm's motion needs for a contact where velocities are frozen, zero, of another
sign or unit, or where the clock runs at another speed.
"""

import math

import numpy as np

LARGE_DIFFERENCE = 0.03
"""Velocities contradict the positions if their integral differs by more than this [rad]. In 77,000 packets
of a real UR10e (100 Hz; shamilmamedov, dynamic_calibration) the difference is at most 0.0022 rad; velocities
that are 30 ms late differ by this much when they change by 1 rad/s."""
LARGEST_DIFFERENCE = 2.0 * LARGE_DIFFERENCE
"""A larger difference counts as this [rad], so that it is soon forgotten."""
MEMORY = 0.25
"""Time constant with which differences and movements are forgotten [s]."""
MOVEMENT = 0.005
"""Each movement this long [rad] is compared with the integral of its velocity. In the packets named above the
two differ by at most 13 % of it."""
MOVEMENT_TIME = 0.03
"""Each such movement takes this time at least [s]: time stamps of a host that is up to 10 ms late make the
integral wrong by two thirds of it."""
WRONG = 0.8
"""They contradict each other if they differ by more than this share, as with a velocity of zero. Velocities
that are 8 ms late do not, not even where a movement begins or ends with 40 rad/s^2."""
RIGHT = 0.25
"""They agree if they differ by less than this share."""
AGREED = 4
"""A velocity that was wrong is believed again after so many movements in agreement."""
REST = 0.0005
"""A joint that has moved by less within `MEMORY` is at rest [rad]; in the packets named above positions at
rest change by 0.0002 rad."""
LONGEST_STEP = 0.1
"""Velocities are not integrated over a longer time between two samples [s]."""


class VelocityCheck:
    """Compares the integrated joint velocities of recent samples with the change of the joint positions.

    A joint at rest cannot show whether its velocity is right. So one whose velocity was wrong is not believed
    while it moves, until it has moved in agreement; at rest it is believed.

    Args:
        joints: Number of joints, n.
    """

    def __init__(self, joints: int) -> None:
        self._before: tuple[float, np.ndarray, np.ndarray] | None = None
        # Change of the positions, integral of the velocities, and by how much they differ [rad].
        self._new = np.zeros((3, joints))
        self._recent = np.zeros((3, joints))
        self._movement = np.zeros((3, joints))
        self._time = np.zeros(joints)
        """How long each movement has taken so far [s]."""
        self._doubted = np.zeros(joints, dtype=bool)
        self._agreed = np.zeros(joints, dtype=int)

    def contradict(self, t: float, q: np.ndarray, qd: np.ndarray) -> bool:
        """Whether a sample's velocities contradict its positions and those of the samples before.

        Args:
            t: Time of the sample on the robot's clock [s].
            q: Joint positions, shape (n,) [rad].
            qd: Joint velocities, shape (n,) [rad/s].
        """
        before, self._before = self._before, (t, q, qd)
        if before is None or not 0.0 < t - before[0] <= LONGEST_STEP:
            self._recent[:] = 0.0
            self._movement[:] = 0.0
            self._time[:] = 0.0
            return False
        step = t - before[0]
        change, integral, difference = self._new
        np.subtract(q, before[1], out=change)
        if (np.abs(change) > np.pi).any():  # a joint that turns on and on is counted from -pi again
            change -= 2.0 * np.pi * np.round(change / (2.0 * np.pi))
        np.multiply(qd + before[2], 0.5 * step, out=integral)
        # Between two samples the velocity may have been anything between theirs: a hard stop while packets
        # are lost is no contradiction.
        unknown = 0.5 * step * np.abs(qd - before[2])
        np.subtract(change, integral, out=difference)
        difference -= np.minimum(np.maximum(difference, -unknown), unknown)
        self._movement += self._new
        self._time += step
        self._recent *= math.exp(-step / MEMORY)
        self._recent += self._new
        np.minimum(self._recent, LARGEST_DIFFERENCE, out=self._recent)
        np.maximum(self._recent, -LARGEST_DIFFERENCE, out=self._recent)
        return self._judge()

    def _judge(self) -> bool:
        """Whether a velocity is wrong, or doubted while its joint moves."""
        wrong = np.abs(self._recent[2]) > LARGE_DIFFERENCE
        sizes = np.abs(self._movement)
        lengths = np.maximum(sizes[0], sizes[1])
        complete = (lengths >= MOVEMENT) & (self._time >= MOVEMENT_TIME)
        if complete.any():
            wrong |= self._compare(complete, sizes[2] / np.maximum(lengths, MOVEMENT))
        if wrong.any():
            self._agreed[wrong] = 0
            self._doubted |= wrong
            return True
        if not self._doubted.any():
            return False
        moves = np.abs(self._recent[:2]).max(axis=0) > REST
        return bool((self._doubted & moves).any())

    def _compare(self, complete: np.ndarray, shares: np.ndarray) -> np.ndarray:
        """Take the movements that are complete, and begin the next: which contradict their velocities.

        `shares`: by how much a movement and the integral of its velocity differ.
        """
        self._movement[:, complete] = 0.0
        self._time[complete] = 0.0
        agree = complete & (shares < RIGHT)
        self._agreed = np.where(agree, self._agreed + 1, np.where(complete, 0, self._agreed))
        believed = self._doubted & (self._agreed >= AGREED)
        self._doubted &= ~believed
        self._recent[2, believed] = 0.0
        return complete & (shares > WRONG)
