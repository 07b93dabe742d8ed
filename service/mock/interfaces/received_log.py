"""Times at which the mock received the register writes of reactions: the end of a latency measurement."""

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path

from contactsense.service.mock.interfaces.sent_log import SentLog
from contactsense.service.wire.recipe import Number

CODE, TIME = "input_int_register_47", "input_double_register_46"
"""Input fields with the reaction's code and the time of the sample that caused it."""


class ReceivedLog:
    """Host times at which a nonzero code first arrived for each sample, shared through a file.

    Args:
        path: The file; same layout as a `SentLog`.
        rate: Samples per second [Hz].
        t0: Time stamp of sample 0 [s].
    """

    def __init__(self, path: Path, *, rate: float = 500.0, t0: float = 0.0) -> None:
        self._log, self._rate, self._t0 = SentLog(path, rate=rate, t0=t0), rate, t0

    def note(self, inputs: Mapping[str, Sequence[Number]], host_ns: int) -> None:
        """Record that inputs were written at this host time."""
        code, stamp = inputs.get(CODE), inputs.get(TIME)
        if code and stamp and code[0] and isfinite(stamp[0]) and not self._log.left_ns(float(stamp[0])):
            self._log.note(round((float(stamp[0]) - self._t0) * self._rate), host_ns)
