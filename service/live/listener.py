"""Listeners of the pipeline: what is called with every sample and its estimate, in the pipeline's process."""

from typing import Any, Protocol, runtime_checkable

from contactsense.types import Estimate, Sample

REPORTS = 1000
"""Reports that a listener keeps at most until they are taken."""


class Listener(Protocol):
    """Receives every estimate right after the step, before the service does.

    A listener never blocks. It should not raise either: an exception is caught, counted, and shown in health.
    """

    def receive(self, sample: Sample, estimate: Estimate) -> None:
        """Take the next sample and its estimate."""

    def tick(self, now: float) -> None:
        """Called at least every 10 ms, also without samples. `now` is the host's monotonic clock [s]."""

    def close(self) -> None:
        """Release all resources; the process ends."""


@runtime_checkable
class Reporter(Protocol):
    """A listener that also talks with the service. Reports and commands are JSON objects with a `type`."""

    def take_reports(self) -> list[dict[str, Any]]:
        """Reports to the service since the last call."""

    def command(self, message: dict[str, Any]) -> None:
        """A command from the service; one of an unknown type is for another listener."""
