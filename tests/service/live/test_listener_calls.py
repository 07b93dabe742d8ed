"""Every listener gets every call, whatever another one does."""

from typing import Any, cast

import pytest

from contactsense import Estimate, Sample
from contactsense.service.live.listener_calls import Listeners
from contactsense.service.live.pipeline_connection import REPORT, Outbox
from tests.service.reactions.estimates import estimate, sample


class Posted:
    """In place of the connection to the service."""

    def __init__(self) -> None:
        self.messages: list[tuple[bytes, float, bytes]] = []

    def post(self, kind: bytes, t: float, message: bytes) -> None:
        """As `Outbox.post`."""
        self.messages.append((kind, t, message))


class Noting:
    """A listener that notes its calls, has a report each time, and may fail."""

    def __init__(self, fails: bool = False) -> None:
        self.calls: list[str] = []
        self._fails = fails

    def _note(self, call: str) -> None:
        self.calls.append(call)
        if self._fails:
            raise RuntimeError(call)

    def receive(self, sample: Sample, estimate: Estimate) -> None:
        self._note(f"receive {sample.t:g} {estimate.t:g}")

    def tick(self, now: float) -> None:
        self._note(f"tick {now:g}")

    def command(self, message: dict[str, Any]) -> None:
        self._note(f"command {message['type']}")

    def take_reports(self) -> list[dict[str, Any]]:
        return [{"calls": len(self.calls)}]

    def close(self) -> None:
        self._note("close")


@pytest.mark.parametrize("fails", [False, True])
def test_all_listeners_get_all_calls_and_their_reports_are_sent(fails: bool) -> None:
    posted, both = Posted(), (Noting(fails), Noting())
    listeners = Listeners(both, cast(Outbox, posted))
    listeners.receive(sample(1.5), estimate(1.5))
    listeners.tick(100.0)
    listeners.command({"type": "acknowledge"})
    listeners.close()
    expected = ["receive 1.5 1.5", "tick 100", "command acknowledge", "close"]
    assert [listener.calls for listener in both] == [expected, expected]
    assert posted.messages == [
        (REPORT, t, b'{"calls": %d}' % count) for t, count in ((1.5, 1), (100.0, 2), (0.0, 4)) for _ in both
    ]
    assert listeners.errors.count == (4 if fails else 0)
