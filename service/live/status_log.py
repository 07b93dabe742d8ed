"""Which states of the service are worth a line in the log."""

import re
from collections.abc import Sequence

from contactsense.service.live.status import Status

PAUSE = 60.0
"""A reason that was absent for less has not ended, but comes and goes [s]."""
_MOST = 4
"""Reasons in a line. Hundreds of actions may fail, each with a reason of its own."""
_NUMBER = re.compile(r"(?<![\w/-])(?<!\w\[)[-+]?[0-9][0-9.]*(?:e[-+]?[0-9]+)?|[0-9]{8}T[0-9]{6}-[0-9]+")
"""A number that tells how much, such as an age; none within a name, such as `lamp-2` or `joint_torque[2]`.
Or time and number in the name of a recording's file: each attempt to write one has another name."""


class StatusLog:
    """Remembers what the log says: a wrong scene gives reasons that alternate several times a second."""

    def __init__(self) -> None:
        self._status: Status | None = None
        self._seen: dict[str, float] = {}
        """Reasons without their numbers, and when each was last the case [s]."""

    def news(self, status: Status, reasons: Sequence[str], now: float) -> str:
        """What the log is to say of the status: its reasons, those first that it has not had for a while.
        Empty if there are none and it has not changed.

        Args:
            status: The present one.
            reasons: Why. Their numbers, such as ages, grow all the time.
            now: Time on any clock that does not go back [s].
        """
        changed = status != self._status
        if changed:
            self._status = status
            self._seen.clear()
        # Others are forgotten: what they quote, such as the words of a program, may differ each time.
        self._seen = {reason: then for reason, then in self._seen.items() if now - then <= PAUSE}
        plain = [_NUMBER.sub("", reason) for reason in reasons]
        new = [reason for reason, key in zip(reasons, plain, strict=True) if key not in self._seen]
        known = [reason for reason, key in zip(reasons, plain, strict=True) if key in self._seen]
        self._seen.update(dict.fromkeys(plain, now))
        if not (changed or new):
            return ""
        told = [*new, *known]
        if len(told) > _MOST + 1:
            told = [*told[:_MOST], f"and {len(told) - _MOST} more reasons, which GET /v1/health has"]
        return "; ".join(told)
