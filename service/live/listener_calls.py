"""Calls the listeners of the pipeline, and passes on what they report."""

import contextlib
import json
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from contactsense.service.live.error_count import ErrorCount
from contactsense.service.live.listener import Listener, Reporter
from contactsense.service.live.pipeline_connection import REPORT, Outbox
from contactsense.types import Estimate, Sample

_L = TypeVar("_L")


class Listeners:
    """Calls the listeners. Exceptions of a listener do not stop the pipeline.

    Args:
        listeners: The listeners, in the order in which they are called.
        outbox: Where their reports to the service are posted.
    """

    def __init__(self, listeners: Sequence[Listener], outbox: Outbox) -> None:
        self._listeners = listeners
        self._reporters = [listener for listener in listeners if isinstance(listener, Reporter)]
        self._outbox = outbox
        self.errors = ErrorCount()
        """Their exceptions, and commands to them that were refused."""

    def receive(self, sample: Sample, estimate: Estimate) -> None:
        """Pass a sample and its estimate to all listeners."""
        self._each(self._listeners, lambda listener: listener.receive(sample, estimate))
        self._send_reports(estimate.t)

    def tick(self, now: float) -> None:
        """Let all listeners do what is due at this time of the host's monotonic clock [s]."""
        self._each(self._listeners, lambda listener: listener.tick(now))
        self._send_reports(now)

    def command(self, message: dict[str, Any]) -> None:
        """Pass a command of the service to all listeners."""
        self._each(self._reporters, lambda reporter: reporter.command(message))

    def close(self) -> None:
        """Close all listeners, and pass on what they report of it, such as of files that are complete now."""
        self._each(self._listeners, lambda listener: listener.close())
        with contextlib.suppress(OSError):  # the service has ended
            self._send_reports(0.0)

    def _each(self, listeners: Sequence[_L], call: Callable[[_L], None]) -> None:
        for listener in listeners:
            with self.errors.catching(type(listener).__name__):
                call(listener)

    def _send_reports(self, t: float) -> None:
        messages: list[bytes] = []

        def collect(reporter: Reporter) -> None:
            for report in reporter.take_reports():
                # A report that is no JSON loses none of the others.
                with self.errors.catching(type(reporter).__name__):
                    messages.append(json.dumps(report).encode())

        self._each(self._reporters, collect)
        for message in messages:
            # The end of the service is no error of a listener.
            self._outbox.post(REPORT, t, message)
