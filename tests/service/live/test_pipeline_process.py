"""The pipeline's side of the wire: it never waits for the service."""

import json
import multiprocessing
import socket
import threading
import time
from collections.abc import Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contactsense import Estimate, Sample, Scene
from contactsense.service.api.messages import EstimateOut
from contactsense.service.live.error_times import ErrorTimes
from contactsense.service.live.listener_calls import Listeners
from contactsense.service.live.pipeline_connection import (
    ESTIMATE,
    HEAD,
    HEALTH,
    LAST_WORDS,
    REPORT,
    Inbox,
    Outbox,
)
from contactsense.service.live.pipeline_process import (
    ANOTHER_SOURCE,
    ListenerFactory,
    _as_message,
    run,
    work,
)
from contactsense.service.process_argument import packed
from contactsense.service.recordings.writing.clip_listener import ClipListener, RecordingSettings
from contactsense.service.sensors.clients.netft_client import WrenchHealth
from contactsense.service.sensors.clients.robot_stream import State, StreamHealth
from contactsense.service.sensors.source_health import SourceHealth
from tests.service import fakes
from tests.service.loopback import until


def read_all(connection: socket.socket) -> list[tuple[bytes, float, bytes]]:
    connection.setblocking(False)
    data = b""
    try:
        while chunk := connection.recv(1 << 16):
            data += chunk
    except BlockingIOError:
        pass
    return messages_in(data)


def messages_in(data: bytes) -> list[tuple[bytes, float, bytes]]:
    messages = []
    while data:
        kind, t, size = HEAD.unpack_from(data)
        messages.append((kind, t, data[HEAD.size : HEAD.size + size]))
        data = data[HEAD.size + size :]
    return messages


def test_an_outbox_nobody_empties_drops_the_oldest_and_never_waits() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        outbox = Outbox(ours, size=50)
        count = 20_000
        for i in range(count):
            outbox.post(ESTIMATE, float(i), b"%06d" % i * 20)
        arrived = []
        while got := read_all(theirs):
            arrived += got
            outbox.flush()
    numbers = [int(payload[:6]) for _, _, payload in arrived]
    assert outbox.dropped > 0
    assert len(numbers) == count - outbox.dropped
    assert all(a < b for a, b in pairwise(numbers))
    assert numbers[-50:] == list(range(count - 50, count))  # the newest survive
    assert all(payload == payload[:6] * 20 for _, _, payload in arrived)  # none torn


def test_an_outbox_without_a_reader_says_so() -> None:
    ours, theirs = socket.socketpair()
    theirs.close()
    with ours, pytest.raises(BrokenPipeError):
        Outbox(ours).post(ESTIMATE, 0.0, b"x")


class Ten:
    """Ten samples, then the reader hangs up."""

    streams = 1

    def __init__(self, reader: socket.socket) -> None:
        self.reader, self.arrived, self.calls = reader, list[tuple[bytes, float, bytes]](), 0

    @property
    def health(self) -> SourceHealth:
        robot = StreamHealth(state="streaming", received=10, lost=2)
        return SourceHealth(robot, wrench=None, unusable=3, without_wrench=4)

    def poll(self, timeout: float) -> list[Sample]:
        self.calls += 1
        if self.calls == 1:
            return [Sample(0.002 * i, np.zeros(6), np.zeros(6)) for i in range(10)]
        self.arrived = read_all(self.reader)
        self.reader.close()
        return [Sample(1.0, np.zeros(6), np.zeros(6))]

    def close(self) -> None:
        pass


class Idle:
    """Finds nothing, at a covariance that is not bounded."""

    def step(self, sample: Sample) -> Estimate:
        return Estimate(sample.t, "none", (), np.zeros(7), np.zeros(6), np.full((6, 6), np.inf))

    def restart(self, why: str) -> None:
        raise AssertionError(why)


def test_samples_become_messages() -> None:
    ours, theirs = socket.socketpair()
    source = Ten(theirs)
    with ours, pytest.raises(BrokenPipeError):
        run(source, Idle(), Outbox(ours))
    kinds = [kind for kind, _, _ in source.arrived]
    assert kinds == [ESTIMATE] * 10 + [HEALTH]
    assert [t for _, t, _ in source.arrived[:10]] == [0.002 * i for i in range(10)]
    estimate = EstimateOut.model_validate_json(source.arrived[3][2])
    assert estimate.status == "none"
    assert estimate.covariance == [[None] * 6] * 6  # JSON knows no infinity
    report = json.loads(source.arrived[10][2])
    assert report["source"]["connected"]
    robot = {"state": "streaming", "received": 10, "lost": 2, "last_error": "", "last_error_time": None}
    assert report["source"]["robot"] == robot
    assert (report["source"]["without_wrench"], report["source"]["unusable"]) == (4, 3)
    assert report["pipeline"]["alive"]


class TwoControllers(Ten):
    """One controller, then another."""

    @property
    def streams(self) -> int:
        return min(self.calls, 2)

    def poll(self, timeout: float) -> list[Sample]:
        self.calls += 1
        if self.calls < 3:
            return [Sample(0.002 * i, np.zeros(6), np.zeros(6)) for i in range(2)]
        self.arrived = read_all(self.reader)
        self.reader.close()
        return [Sample(1.0, np.zeros(6), np.zeros(6))]


class Restarted(Idle):
    """Notes before which sample it was restarted."""

    def __init__(self) -> None:
        self.count = 0
        self.restarts: list[tuple[int, str]] = []

    def step(self, sample: Sample) -> Estimate:
        self.count += 1
        return super().step(sample)

    def restart(self, why: str) -> None:
        self.restarts.append((self.count, why))


def test_another_controller_begins_another_stream() -> None:
    ours, theirs = socket.socketpair()
    source, localizer = TwoControllers(theirs), Restarted()
    with ours, pytest.raises(BrokenPipeError):
        run(source, localizer, Outbox(ours))
    assert localizer.restarts == [(2, ANOTHER_SOURCE)]
    kinds = [kind for kind, _, _ in source.arrived if kind != HEALTH]
    assert kinds == [REPORT, ESTIMATE, ESTIMATE, REPORT, ESTIMATE, ESTIMATE]
    assert json.loads(next(text for kind, _, text in source.arrived if kind == REPORT)) == {"type": "stream"}


def test_each_sensor_on_the_network_has_its_state() -> None:
    def wrench(state: State, error: str, received: int, lost: int) -> WrenchHealth:
        return WrenchHealth(state, error, received, lost, 0, 0, 0, 0, 0, 0, 1000.0, 0.001)

    health = SourceHealth(
        StreamHealth(state="connecting", error="no answer", received=500),
        wrench("streaming", "", 499, 0),
        unusable=0,
        without_wrench=0,
        links={"link_wrenches.elbow": wrench("streaming", "no answer", 7, 3)},
    )
    times = ErrorTimes(map("2026-01-01T00:00:0{}Z".format, (1, 0)).__next__)
    told = _as_message(health, times)
    assert (told.connected, told.trouble) == (False, health.trouble_while_running)
    assert told.robot.last_error_time == "2026-01-01T00:00:01Z"
    assert told.base_wrench is not None
    assert (told.base_wrench.received, told.base_wrench.last_error_time) == (499, None)
    elbow = told.link_wrenches["elbow"]
    assert (elbow.state, elbow.received, elbow.lost) == ("streaming", 7, 3)
    assert (elbow.last_error, elbow.last_error_time) == ("no answer", "2026-01-01T00:00:00Z")


class Talkative:
    """A listener that does nothing but report."""

    def __init__(self, *reports: dict[str, Any]) -> None:
        self._reports = list(reports)

    def receive(self, sample: Sample, estimate: Estimate) -> None:
        pass

    def tick(self, now: float) -> None:
        pass

    def close(self) -> None:
        pass

    def command(self, message: dict[str, Any]) -> None:
        pass

    def take_reports(self) -> list[dict[str, Any]]:
        taken, self._reports = self._reports, []
        return taken


class Unable(Talkative):
    """It cannot even report."""

    def take_reports(self) -> list[dict[str, Any]]:
        raise RuntimeError("deque mutated during iteration")


def test_a_listener_that_cannot_report_is_counted_and_holds_up_no_other() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        listeners = Listeners([Unable(), Talkative({"type": "a"})], Outbox(ours))
        listeners.tick(1.0)
        assert [json.loads(report) for _, _, report in read_all(theirs)] == [{"type": "a"}]
    assert listeners.errors.count == 1
    assert listeners.errors.last == "Unable: RuntimeError: deque mutated during iteration"


def test_a_report_that_is_no_json_is_counted_and_loses_none_of_the_others() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        listeners = Listeners([Talkative({"type": "a"}, {"type": {1, 2}}, {"type": "b"})], Outbox(ours))
        listeners.tick(1.0)
        assert [json.loads(report)["type"] for _, _, report in read_all(theirs)] == ["a", "b"]
    assert listeners.errors.count == 1
    assert listeners.errors.last.startswith("Talkative: TypeError")


def test_the_end_of_the_service_is_no_error_of_a_listener() -> None:
    ours, theirs = socket.socketpair()
    theirs.close()
    with ours:
        listeners = Listeners([Talkative({"type": "a"})], Outbox(ours))
        with pytest.raises(BrokenPipeError):
            listeners.tick(1.0)
        Listeners([Talkative({"type": "a"})], Outbox(ours)).close()
    assert listeners.errors.count == 0


def test_a_command_that_is_too_long_is_refused_and_no_other() -> None:
    ours, theirs = socket.socketpair()
    long = {"type": "restore", "decisions": ["x" * (1 << 20)]}
    sent = b"".join(json.dumps(command).encode() + b"\n" for command in ({"type": "a"}, long, {"type": "b"}))
    refusals: list[str] = []
    with ours, theirs:
        ours.setblocking(False)
        inbox = Inbox(ours, refusals.append)
        writer = threading.Thread(target=theirs.sendall, args=(sent,))
        writer.start()
        taken: list[dict[str, Any]] = []
        assert until(lambda: taken.extend(inbox.take()) or len(taken) == 2)
        writer.join()
    assert [command["type"] for command in taken] == ["a", "b"]
    (refusal,) = refusals
    assert refusal.startswith('command {"type": "restore", "decisions": ["x')
    assert refusal.endswith("...: expected at most 1048576 bytes, got more; it is left out")


def test_a_refused_command_is_told_by_health() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        listeners = Listeners((), Outbox(ours))
        listeners.errors.add("command x...: expected at most 3 bytes, got more; it is left out")
        with pytest.raises(BrokenPipeError):
            run(source := Ten(theirs), Idle(), Outbox(ours), listeners)
    report = json.loads(source.arrived[-1][2])["pipeline"]
    assert (report["listener_errors"], report["last_listener_error"][:9]) == (1, "command x")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("source", "said", "traceback"),
    [
        (fakes.Overflowing, b"ValueError: no such field", True),
        # Told as long as it lasts, each time that the process is started again.
        (fakes.OlderController, b"the controller does not know actual_current_as_torque", False),
    ],
)
def test_last_words_behind_a_backlog_are_sent(
    source: type[fakes.Steady], said: bytes, traceback: bool, capfd: pytest.CaptureFixture[str]
) -> None:
    (kind, _, text), exit_code = last_behind_a_backlog(source)
    assert (kind, text) == (LAST_WORDS, said)
    assert exit_code == 1
    assert ("Traceback" in capfd.readouterr().err) == traceback


@pytest.mark.slow
def test_last_reports_behind_a_backlog_are_sent_to_a_service_that_sends_nothing_more(tmp_path: Path) -> None:
    listener = partial(ClipListener, settings=RecordingSettings(folder=tmp_path), rate=500.0)
    clip = json.dumps({"type": "clip", "number": 7, "after": 60.0}).encode() + b"\n"
    (kind, _, report), exit_code = last_behind_a_backlog(fakes.Steady, [listener], clip)
    assert (kind, exit_code) == (REPORT, 0)
    assert (tmp_path / json.loads(report)["file"]).is_file()


def last_behind_a_backlog(
    source: type[fakes.Steady], listeners: Sequence[ListenerFactory] = (), commands: bytes = b""
) -> tuple[tuple[bytes, float, bytes], int | None]:
    """The last message of a process whose messages are read late, and its exit code."""
    ours, theirs = socket.socketpair()
    process = multiprocessing.get_context("spawn").Process(target=work, args=(theirs, source, listeners))
    with ours:
        with theirs:
            process.start()
        ours.sendall(packed(Scene(robot="ur5e")) + commands)
        # It may compile. Of short messages a connection holds fewer bytes than of long ones.
        assert until(lambda: len(ours.recv(1 << 20, socket.MSG_PEEK)) > 1 << 14, 280.0)
        time.sleep(0.5)  # until it is full, and for a process that would not wait until its messages are read
        ours.shutdown(socket.SHUT_WR)
        time.sleep(0.5)
        data = b""
        while chunk := ours.recv(1 << 16):
            data += chunk
    process.join()
    return messages_in(data)[-1], process.exitcode


def test_a_service_that_does_not_read_holds_up_no_end() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        outbox = Outbox(ours)
        for i in range(1000):
            outbox.post(ESTIMATE, float(i), bytes(1000))
        begin = time.monotonic()
        outbox.finish(0.1)
        assert time.monotonic() - begin < 5.0
