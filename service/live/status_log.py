"""Which states of the service are worth a line in the log."""

import re

from contactsense.service.live.status import Status

PAUSE = 60.0
"""A reason that was absent for less has not ended, but comes and goes [s]."""


class StatusLog:
    """Remembers what the log says: a wrong scene gives reasons that alternate several times a second."""

    def __init__(self) -> None:
        self._status: Status | None = None
        self._seen: dict[str, float] = {}
        """Reasons without their numbers, and when each was last the case [s]."""

    def is_news(self, status: Status, message: str, now: float) -> bool:
        """Whether the status has changed, or has a reason that it has not had for a while.

        Args:
            status: The present one.
            message: Its reasons, separated by semicolons. Their numbers, such as ages, grow all the time.
            now: Time on any clock that does not go back [s].
        """
        changed = status != self._status
        if changed:
            self._status = status
            self._seen.clear()
        reasons = set(re.sub(r"[0-9.]+", "", message).split("; "))
        news = any(now - self._seen.get(reason, -float("inf")) > PAUSE for reason in reasons)
        self._seen.update(dict.fromkeys(reasons, now))
        return changed or news
