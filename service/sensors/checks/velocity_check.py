"""Whether a robot's joint velocities are those with which its joint positions change.

The observers take what the arm's motion needs for a contact where velocities are frozen, zero, of another
sign or unit, or where the clock runs at another speed.
"""

import math

import numpy as np

LARGE_DIFFERENCE = 0.03
"""Velocities contradict the positions if their integral differs by more than this [rad], beyond what lateness
explains. In 77,000 packets of a real UR10e (100 Hz; shamilmamedov, dynamic_calibration) the difference is at
most 0.0022 rad."""
MEMORY = 0.25
"""Time constant with which differences and movements are forgotten [s]: an offset or noise of the velocity of
an arm at rest is no movement."""
MOVEMENT = 0.005
"""Each movement this long [rad], or longer at high speed, is compared with the integral of its velocity. In
the packets named above the two differ by at most 7 % of it."""
LATENESS_SHARE = 0.25
"""A movement is so long that lateness explains a difference of at most this share of it."""
WRONG = 0.8
"""A movement and the integral of its velocity contradict each other if they differ by more than this share of
the larger, as with a velocity of zero."""
RIGHT = 0.3
"""They agree if they differ by less than this share."""
AGREED = 4
"""A velocity that was wrong is used again after this number of movements in agreement."""
FASTEST = np.pi
"""A higher velocity [rad/s] explains no larger difference: it may be in degrees per second."""
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
        late: By how much right velocities, or the time stamps, may be late [s]: where the speed changes they
            differ by as much as the joint moves in this time.
    """

    def __init__(self, joints: int, late: float) -> None:
        self._late = late
        self._before: tuple[float, np.ndarray, np.ndarray] | None = None
        # Change of the positions, integral of the velocities, and by how much they differ [rad].
        self._new = np.zeros((3, joints))
        self._recent = np.zeros((3, joints))
        self._movement = np.zeros((3, joints))
        self._fastest = np.zeros(joints)
        self._doubted = np.zeros(joints, dtype=bool)
        self._agreed = np.zeros(joints, dtype=int)
        self._wrong = False

    def contradict(self, t: float, q: np.ndarray, qd: np.ndarray) -> bool:
        """Whether a sample's velocities contradict its positions and those of the samples before.

        Args:
            t: Time of the sample on the robot's clock [s].
            q: Joint positions, shape (n,) [rad].
            qd: Joint velocities, shape (n,) [rad/s].
        """
        before = self._before
        if before is not None and t == before[0]:
            return self._wrong
        self._before = (t, q, qd)
        if before is None:
            return False
        step = t - before[0]
        change, integral, difference = self._new
        np.subtract(q, before[1], out=change)
        if (np.abs(change) > np.pi).any():  # a joint that turns on and on is counted from -pi again
            change -= 2.0 * np.pi * np.round(change / (2.0 * np.pi))
        if not 0.0 < step <= LONGEST_STEP:
            for sums in (self._recent, self._movement, self._fastest):
                sums[:] = 0.0
            moves = (np.abs(change) > REST) | (np.abs(qd) * MEMORY > REST)
            self._wrong = bool((self._doubted & moves).any())
            return self._wrong
        np.multiply(qd + before[2], 0.5 * step, out=integral)
        # Between two samples the velocity may have been anything between theirs: a hard stop while packets
        # are lost is no contradiction.
        unknown = 0.5 * step * np.abs(qd - before[2])
        np.subtract(change, integral, out=difference)
        difference -= np.minimum(np.maximum(difference, -unknown), unknown)
        kept = math.exp(-step / MEMORY)
        self._fastest *= kept
        np.maximum(self._fastest, np.minimum(np.abs(qd), FASTEST), out=self._fastest)
        self._movement *= kept
        self._movement += self._new
        self._recent *= kept
        self._recent += self._new
        self._wrong = self._judge(self._late * self._fastest)
        return self._wrong

    def _judge(self, explained: np.ndarray) -> bool:
        """Whether a velocity is wrong, or doubted while its joint moves.

        `explained`: difference that lateness explains, shape (n,) [rad].
        """
        largest = LARGE_DIFFERENCE + explained
        # So that it is soon forgotten.
        np.minimum(self._recent, 2.0 * largest, out=self._recent)
        np.maximum(self._recent, -2.0 * largest, out=self._recent)
        wrong = np.abs(self._recent[2]) > largest
        sizes = np.abs(self._movement)
        lengths = np.maximum(sizes[0], sizes[1])
        complete = lengths >= MOVEMENT + explained / LATENESS_SHARE
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
        agree = complete & (shares < RIGHT)
        self._agreed = np.where(agree, self._agreed + 1, np.where(complete, 0, self._agreed))
        believed = self._doubted & (self._agreed >= AGREED)
        self._doubted &= ~believed
        self._recent[2, believed] = 0.0
        return complete & (shares > WRONG)
