"""Whether a stream has never fitted a free arm: a contact that is there from the first sample on may be none.

A wrong line of a scene gives readings that no free arm has, from the start and in all postures. So does a
hand that holds the arm at the start, until it lets go.
"""

import math

import numpy as np

from contactsense.residuals.residual_ewma import RELATIVE_BANDWIDTH
from contactsense.residuals.sensor_consistency import AVERAGING_TIME
from contactsense.sensors.stream_state import (
    ALL_MISSING,
    BLIND,
    INCONSISTENT,
    INVALID,
    REPEATED,
    RESTARTED,
    SETTLING,
    SETTLING_PERIODS,
    TOUCHED,
    UNUSABLE,
)

FROM_START = (
    "the readings have not fitted a free arm since the stream began: if nothing touches it, a line of the "
    "scene is wrong, and `contactsense check SCENE` finds it"
)
_MARGIN = 0.1
"""A contact is detected at most so long after the observers have settled, if it was there before: two samples
at the lowest rate [s]."""
_CONSISTENCY_TIME = 3.0 * AVERAGING_TIME
"""Residuals that are too large from the start are inconsistent by then [s]."""
_FREE_TIME = 1.0
"""An arm that has been free for so long was held before [s]."""
_UNINFORMATIVE = UNUSABLE | REPEATED | SETTLING | BLIND
"""Flags of samples that tell nothing."""
_UNFIT = TOUCHED | INCONSISTENT


class StreamStart:
    """Follows the flags of one stream's samples."""

    def __init__(self, bandwidth: float, averages: bool) -> None:
        """Begin with the stream.

        Args:
            bandwidth: Cut-off frequency of the observers [Hz].
            averages: Whether the average of the residuals is tested, too: it shows later what is there from
                the start.
        """
        self._window = SETTLING_PERIODS / bandwidth + _MARGIN
        if averages:
            self._window += SETTLING_PERIODS / (RELATIVE_BANDWIDTH * bandwidth)
        self.reset()

    def reset(self) -> None:
        """A new stream begins."""
        self._seen, self._begin, self._free_since = 0, math.nan, math.inf
        self._decided = self._was_touched = False
        self.doubtful = False
        """Whether the readings have not fitted a free arm so far."""
        self.watches = True
        """Whether samples without any flag matter."""

    def update(self, t: float, flags: int) -> bool:
        """Take in one sample; returns whether it belongs to what has been there since the start.

        Args:
            t: Time of the sample [s].
            flags: Of the sample, see `contactsense.sensors.stream_state`; none for sensors that the scene
                does not have.
        """
        if flags & (UNUSABLE | REPEATED):
            return False
        found = self._update(t, flags)
        self.watches = not self._decided or self._seen != ALL_MISSING
        return found

    def _update(self, t: float, flags: int) -> bool:
        if flags & RESTARTED:
            self.reset()
        present = ALL_MISSING & ~(flags | flags // INVALID)
        if present & ~self._seen:
            # A sensor that joins later has a start of its own.
            self._seen |= present
            if not self.doubtful:
                self._begin, self._decided, self._was_touched = t, False, False
        if self._decided or flags & _UNINFORMATIVE:
            return False
        if self.doubtful:
            return self._goes_on(t, flags)
        age = t - self._begin
        if flags & TOUCHED:
            self.doubtful = age <= self._window
            self._was_touched = not self.doubtful
        elif flags & INCONSISTENT:
            self.doubtful = age <= _CONSISTENCY_TIME
        self._decided = self._was_touched or (not self.doubtful and age > _CONSISTENCY_TIME)
        self._free_since = math.inf
        return self.doubtful

    def update_block(self, t: np.ndarray, flags: np.ndarray) -> None:
        """The same for N samples of a recording: times [s] and flags, shape (N,)."""
        if len(t) == 0:
            return
        # Only changes of the flags matter, and the last sample.
        changes = np.flatnonzero(np.diff(flags)) + 1
        for i in (0, *changes.tolist(), len(t) - 1):
            if self.watches or flags[i] & RESTARTED:
                self.update(float(t[i]), int(flags[i]))

    def _goes_on(self, t: float, flags: int) -> bool:
        if t - self._free_since >= _FREE_TIME:
            self.doubtful, self._decided = False, True
            return False
        if flags & _UNFIT:
            self._free_since = math.inf
            return True
        self._free_since = min(self._free_since, t)
        return False
