"""What the pipeline's process tells of itself, at times that a test sets."""

import json
import re
import socket
import threading
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np
import pytest

from contactsense import Estimate, Sample
from contactsense.service.live import pipeline_process
from contactsense.service.live.listener_calls import Listeners
from contactsense.service.live.pipeline_connection import ESTIMATE, HEALTH, LOADING, REPORT, Inbox, Outbox
from contactsense.service.live.pipeline_process import _reported_loading, run
from contactsense.service.sensors.clients.robot_stream import StreamHealth
from contactsense.service.sensors.source_health import SourceHealth
from contactsense.types import Event
from tests.service.live.test_listener_calls import Noting, Posted
from tests.service.live.test_pipeline_process import read_all
from tests.service.loopback import until
from tests.service.reactions.estimates import SCENE, contact, estimate, sample


@dataclass
class Clock:
    """In place of the module `time`."""

    now: float = 1000.0
    steps: float = 0.0

    def monotonic(self) -> float:
        return self.now

    def perf_counter(self) -> float:
        return self.steps


@dataclass
class Scripted:
    """Samples as a test says, and the end of the service after them.

    Args:
        clock: Moves on with each poll.
        polls: How long each takes [s], and the number of samples that it returns.
        service: The service's end of the connection.
    """

    clock: Clock
    polls: list[tuple[float, int]]
    service: socket.socket
    received: list[tuple[bytes, float, bytes]] = field(default_factory=list)
    count: int = 0
    streams: int = 1

    @property
    def health(self) -> SourceHealth:
        return SourceHealth(StreamHealth(state="streaming"), None, unusable=0, without_wrench=0)

    def poll(self, timeout: float) -> list[Sample]:
        assert timeout <= 0.02  # listeners and commands wait for it
        self.received += read_all(self.service)
        if not self.polls:
            self.service.close()
            return [sample(9.0)]
        took, number = self.polls.pop(0)
        self.clock.now += took
        self.count += number
        return [sample(0.002 * (self.count - number + i)) for i in range(number)]

    def close(self) -> None:
        pass


@dataclass
class Pushed:
    """Steps that take 1 ms, but the first 3 ms, with a push at the second sample."""

    clock: Clock

    def step(self, sample: Sample) -> Estimate:
        if sample.t == 0.0:
            self.clock.steps += 0.003
            return estimate(0.0)
        self.clock.steps += 0.001
        onset = (Event("onset", 1, sample.t),) if sample.t == 0.002 else ()
        return replace(estimate(sample.t, contact()), events=onset)

    def restart(self, why: str) -> None:
        raise AssertionError(why)


def played(
    monkeypatch: pytest.MonkeyPatch, polls: list[tuple[float, int]], *commands: dict[str, Any]
) -> tuple[list[tuple[bytes, float, bytes]], Noting, Outbox]:
    """Messages of a run until its service ends, the listener's calls, and the connection."""
    clock, listener = Clock(), Noting(fails=True)
    monkeypatch.setattr(pipeline_process, "time", clock)
    ours, theirs = socket.socketpair()
    with ours:
        outbox = Outbox(ours)
        outbox.dropped = 7
        source = Scripted(clock, polls, theirs)
        theirs.sendall(b"".join(json.dumps(command).encode() + b"\n" for command in commands))
        listeners = Listeners([listener], outbox)
        with pytest.raises(BrokenPipeError):
            run(source, Pushed(clock), outbox, listeners, Inbox(ours, print), "real time")
    return source.received, listener, outbox


def test_health_is_told_four_times_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    # A second, of which the last step comes late, half a second with samples, then none.
    polls = [(0.125, 5)] * 7 + [(0.375, 5)] + [(0.125, 4)] * 4 + [(0.125, 0)] * 6
    received, _, _ = played(monkeypatch, polls)
    told = [(t, json.loads(text)) for kind, t, text in received if kind == HEALTH]
    assert [t - 1000.0 for t, _ in told] == [
        *(0.125, 0.375, 0.625, 0.875),
        *(1.25, 1.5, 1.75, 2.0, 2.25, 2.5),
    ]
    assert [report["source"]["rate"] for _, report in told] == [0.0] * 4 + [32.0] * 4 + [16.0] * 2
    assert [report["source"]["age"] for _, report in told] == [0.0] * 7 + [0.25, 0.5, 0.75]


def test_the_process_tells_of_its_steps_and_errors(monkeypatch: pytest.MonkeyPatch) -> None:
    received, _, _ = played(monkeypatch, [(0.125, 0), (0.25, 2)])
    first, last = (json.loads(text) for kind, _, text in received if kind == HEALTH)
    assert (first["source"]["age"], first["pipeline"]["step"]) == (None, None)
    pipeline = last["pipeline"]
    assert pipeline["step"] == pytest.approx(0.003 + 0.02 * (0.001 - 0.003))
    assert (sum(pipeline["step_counts"]), pipeline["step_sum"]) == (2, pytest.approx(0.004))
    assert (pipeline["dropped"], pipeline["scheduling"]) == (7, "real time")
    # The listener fails at each call: two ticks and two samples.
    assert (pipeline["listener_errors"], pipeline["last_listener_error"]) == (
        4,
        "Noting: RuntimeError: tick 1000.38",
    )


def test_events_come_before_their_estimate_and_listeners_before_both(monkeypatch: pytest.MonkeyPatch) -> None:
    received, listener, _ = played(monkeypatch, [(0.125, 2)], {"type": "acknowledge"})
    told = [(kind, t, json.loads(text)) for kind, t, text in received]
    told = [(kind, t, content) for kind, t, content in told if "calls" not in content]
    assert [(kind, t) for kind, t, _ in told] == [
        *((ESTIMATE, 0.0), (REPORT, 0.002), (ESTIMATE, 0.002)),
        (HEALTH, 1000.125),
    ]
    assert (told[0][2]["q"], told[0][2]["status"]) == (np.zeros(6).tolist(), "none")
    event = told[1][2]["event"]
    assert (event["kind"], event["link"]) == ("onset", "forearm")
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}\+00:00", event["time"])
    assert listener.calls[:4] == ["receive 0 0", "receive 0.002 0.002", "command acknowledge", "tick 1000.12"]


def test_loading_is_reported_until_it_is_over(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pipeline_process, "HEARTBEAT", 0.01)
    posted = Posted()
    with _reported_loading(SCENE, cast(Outbox, posted)):
        assert until(lambda: len(posted.messages) > 1)
    assert all(thread.name != "loading report" for thread in threading.enumerate())
    kind, _, text = posted.messages[-1]
    assert (kind, set(json.loads(text))) == (LOADING, {"share", "left"})


def test_a_service_that_ends_while_kernels_are_loaded_ends_the_process() -> None:
    ours, theirs = socket.socketpair()
    theirs.close()
    with ours, pytest.raises(BrokenPipeError), _reported_loading(SCENE, Outbox(ours)):
        pass
