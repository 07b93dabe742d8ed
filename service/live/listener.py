"""Listeners of the pipeline: called with every sample and its estimate, in the pipeline's process."""

from typing import Any, Protocol, runtime_checkable

from contactsense.types import Estimate, Sample

REPORTS = 1000
"""Maximum number of reports that a listener keeps until they are taken."""


class Listener(Protocol):
    """Receives every estimate right after the localizer's step, before the service does.

    A listener must never block. It should not raise either: an exception is caught, counted, and shown in
    health.
    """

    def receive(self, sample: Sample, estimate: Estimate) -> None:
        """Process the next sample and its estimate."""

    def tick(self, now: float) -> None:
        """Called at least every 10 ms, also without samples. `now` is the host's monotonic clock [s]."""

    def close(self) -> None:
        """Release all resources; called before the process ends."""


@runtime_checkable
class Reporter(Protocol):
    """A listener that exchanges messages with the service: JSON objects with a `type`."""

    def take_reports(self) -> list[dict[str, Any]]:
        """Return the reports for the service since the last call."""

    def command(self, message: dict[str, Any]) -> None:
        """Execute a command from the service; commands of unknown types are for other listeners."""
