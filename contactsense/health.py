"""Do model and sensors still fit? Statistics of the residuals of a stream, and what to go on with.

Three things are watched. Where nothing touches, each sensor's residual is to be as large as stated. In a
contact base sensor and joint torques are to agree: if for seconds no link makes them agree, the torques,
which hang on friction and drives, are left out. And a base sensor that feels what no push is, while the
joints feel nothing, is left out. What is left out is watched on, and used again once it fits.
"""

import math
from collections.abc import Sequence

import numpy as np

from contactsense.fit import AGREEMENT, BASE, FORCE, TORQUE

PACE = 0.02
"""Residuals are looked at so often: they are low-passed anyway [s]."""
LATELY = 2.0
"""Time over which statistics are averaged [s]."""
LARGE, FINE = 1.6, 1.3
"""Mean square residual, in units of its variance, from which on a sensor does not fit, and below which it
does again."""
APART, TOGETHER = 4.0, 2.0
"""The same for the two against each other."""
MOST = 10.0
"""No single sample counts as worse, so that what is over is over soon."""
ENOUGH = 3.0
"""Doubts that last so long have consequences [s]."""
NO_PUSH = 10.0
"""Forces at the base larger than usual contact forces by this factor, unfelt by the joints, are none."""
_NAMES = ("base_wrench", "joint_torque")


class Health:
    """Of one stream."""

    def __init__(self, force: float, single: bool = True) -> None:
        """Nothing is wrong yet.

        Args:
            force: Usual force of contacts [N].
            single: Whether only one contact at a time is expected. Several may leave the sensors without a
                link on which they agree, so that torques are never left out.
        """
        self._no_push, self._single = NO_PUSH * force, single
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self.level = [1.0, 1.0, 1.0]
        """Lately's mean of `Memory.fit`."""
        self._large = [False, False]
        self._left_out = [False, False]
        self._doubt = [0.0, 0.0]
        """For how long a sensor has been in doubt, or out of it while it is left out [s]."""
        self._waited = 0.0
        self._last: list[str] = []

    def trusted(self, ready: tuple[bool, bool, bool]) -> tuple[bool, bool, bool]:
        """Which of the sensors (base, torques, wrist) that are ready shall be used."""
        if not (ready[0] and ready[1]):
            return ready
        return not self._left_out[0], not self._left_out[1], ready[2]

    def step(self, dt: float, fit: np.ndarray, touched: bool, ready: tuple[bool, bool, bool]) -> list[str]:
        """Take in one sample.

        Args:
            dt: Time since the last [s].
            fit: `Memory.fit`.
            touched: Whether a contact is on.
            ready: Which sensors could be used.

        Returns:
            What is wrong, a phrase each.
        """
        self._waited += dt
        if self._waited >= PACE:
            self._look(self._waited, fit.tolist(), touched, ready)
            self._waited = 0.0
            self._last = self._said()
        return self._last

    def _look(self, dt: float, fit: Sequence[float], touched: bool, ready: tuple[bool, bool, bool]) -> None:
        share = min(dt / LATELY, 1.0)
        for sensor in (BASE, TORQUE):
            if ready[sensor] and not touched and not self._left_out[sensor]:
                self._mean(sensor, share, fit)
                self._large[sensor] = self.level[sensor] > (FINE if self._large[sensor] else LARGE)
        if ready[0] and ready[1]:
            self._mean(AGREEMENT, share, fit)
            agree = self.level[AGREEMENT] if self._single else 1.0
            none = fit[FORCE] > self._no_push and fit[TORQUE] < APART
            self._judge(BASE, dt, none, fit[FORCE] < 0.5 * self._no_push)
            # A base sensor that is left out is no witness against the torques.
            self._judge(TORQUE, dt, agree > APART and not self._left_out[BASE], agree < TOGETHER)

    def _mean(self, what: int, share: float, fit: Sequence[float]) -> None:
        self.level[what] += share * (min(fit[what], MOST) - self.level[what])

    def _judge(self, sensor: int, dt: float, bad: bool, good: bool) -> None:
        against = good if self._left_out[sensor] else bad
        self._doubt[sensor] = self._doubt[sensor] + dt if against else 0.0
        if self._doubt[sensor] >= ENOUGH:
            self._left_out[sensor] = not self._left_out[sensor]
            self._doubt[sensor] = 0.0

    def _said(self) -> list[str]:
        found = [
            f"{name}: without contact its residual is {math.sqrt(self.level[i]):.1f} times as large as noise "
            "and model allow"
            for i, name in enumerate(_NAMES)
            if self._large[i]
        ]
        if self._left_out[BASE]:
            found.append("base_wrench is not used: it feels what no push is, and the joints nothing")
        if self._left_out[TORQUE]:
            found.append("joint_torque is not used: it contradicts base_wrench, whatever link is touched")
        return found
