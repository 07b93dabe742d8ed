"""The order of the samples that one controller sends, and whether each has a time of its own."""

import math

from contactsense.service.controllers.sample_message import MessageError
from contactsense.service.sensors.clients.robot_stream import LATE, LATE_IN_A_ROW


class SampleTimes:
    """Tells late samples, as of a robot, from those of a clock that was set back, and repeated ones."""

    def __init__(self) -> None:
        self._newest, self._late = -math.inf, 0

    def repeats(self, t: float) -> bool:
        """Whether this is the time of the newest sample [s]."""
        return t == self._newest

    def checked(self, t: float) -> bool:
        """Whether the clock was set back before this sample.

        Args:
            t: Time of the sample [s].

        Raises:
            MessageError: It is late, or has the time of the newest one, and must not be used. A time far
                back, or one after many late ones in a row, is that of a clock that was set back.
        """
        if self.repeats(t):
            raise MessageError("t", f"expected a later time than that of the sample before, got {t!r} again")
        back = t < self._newest
        if back and t > self._newest - LATE and self._late < LATE_IN_A_ROW:
            self._late += 1
            raise MessageError(
                "t", f"expected a later time than {self._newest!r} of the sample before, got {t!r}"
            )
        self._newest, self._late = t, 0
        return back
