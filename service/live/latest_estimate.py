"""What the latest estimates say about the state of the service."""

import json

from contactsense.plausibility.stream_start import FROM_START

LONE = 0.5
"""Estimates that merely lack a reading are reported after this time without any other [s]. The source of the
samples reports how many lack it; a single one that happens to be the latest would make the status flap."""


class LatestEstimate:
    """The latest estimate as JSON, and for how long none was better."""

    def __init__(self) -> None:
        self.payload = b""
        """As it was received; empty before the first."""
        self._bad_since: float | None = None

    def take(self, now: float, payload: bytes) -> None:
        """Keep an estimate that arrived at `now` [s], on any monotonic clock."""
        self.payload = payload
        if b'"status":"degraded"' not in payload[:200]:
            self._bad_since = None
        elif self._bad_since is None:
            self._bad_since = now

    def degraded(self, now: float) -> str:
        """Why the latest estimate is degraded; empty if it is not, or if that is not to be reported yet."""
        if self._bad_since is None:
            return ""
        reason = str(json.loads(self.payload)["reason"])
        of_sample = reason.removesuffix(f"; {FROM_START}")  # which is reported as a doubt about the scene
        lacks_only = all(part.endswith(" is missing") for part in of_sample.split("; "))
        return "" if lacks_only and now - self._bad_since < LONE else reason
