"""The pipeline's side of the executor, against one that a test scripts: what is reported of which decision,
and what becomes of it when the process dies or takes nothing."""

import fcntl
import json
import os
import time
from collections.abc import Iterator
from typing import Any

import pytest

from contactsense.service.reactions.actions.command import CommandAction
from contactsense.service.reactions.executor_client import ExecutorClient

HOST = "127.0.0.1"
TOLD = {"rule": "arm", "level": "collision", "link": "forearm"}
MODULE = "contactsense.service.reactions.executor_client"
POPEN = f"{MODULE}.subprocess.Popen"
PIPE = 4096
"""Size of the pipe through which the scripted executor gets its tasks [bytes], the least that Linux has."""


class ScriptedExecutor:
    """In place of the executor's process: it reports what a test says."""

    started = 0

    def __init__(self, *_: object, **__: object) -> None:
        type(self).started += 1
        self._tasks, tasks = os.pipe()
        fcntl.fcntl(tasks, fcntl.F_SETPIPE_SZ, PIPE)
        read, self._write = os.pipe()
        self.stdin, self.stdout = os.fdopen(tasks, "wb", 0), os.fdopen(read, "rb", 0)
        self.ended: list[str] = []

    def report(self, task: str, ok: bool = True) -> None:
        self.say({"action": "a", "ok": ok, "reason": "", "took": 0.0, "task": task})

    def say(self, message: dict[str, Any]) -> None:
        self.say_bytes(json.dumps(message).encode() + b"\n")

    def say_bytes(self, text: bytes) -> None:
        os.write(self._write, text)

    def kill(self) -> None:
        self.ended.append("killed")
        if self._write >= 0:
            os.close(self._write)
            os.close(self._tasks)
        self._write = -1

    def wait(self, timeout: float | None = None) -> None:
        if timeout is not None:
            self.ended.append("told" if self.stdin.closed else "not told")


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[ExecutorClient, ScriptedExecutor]]:
    """A client of one action with a limit of 2 s, one of which is grace."""
    monkeypatch.setattr(POPEN, ScriptedExecutor)
    client = ExecutorClient({"a": CommandAction(type="command", command=("true",), timeout=1.0)}, HOST)
    process: Any = client._process
    try:
        yield client, process
    finally:
        client.close()


@pytest.mark.parametrize("task", ["newest", "none"])
def test_what_is_reported_of_another_decision_ends_no_waiting(
    scripted: tuple[ExecutorClient, ScriptedExecutor], task: str
) -> None:
    """One that was skipped, or a preparation that failed: the decision that hangs hangs all the same."""
    client, process = scripted
    client.start("a", TOLD, 0.0)
    if task == "newest":
        client.start("a", TOLD, 1.9)
    process.report(task, False)
    assert [result["task"] for result in client.poll(1.95)] == [task]
    (late,) = client.poll(2.1)
    assert late["reason"] == "hangs: no result after 2 s"
    assert late["origin"] == ("arm", "forearm")
    assert late["took"] == pytest.approx(2.1)
    process.report(task, False)
    assert len(client.poll(2.2)) == 1  # it is not reported twice


def test_a_result_has_the_rule_and_the_link_of_its_decision(
    scripted: tuple[ExecutorClient, ScriptedExecutor],
) -> None:
    client, process = scripted
    for link in ("forearm", "wrist_1", "wrist_2"):
        client.start("a", {**TOLD, "link": link}, 0.0)
    for task in ("none", "newest", "oldest", "oldest"):
        process.report(task)
    links = [result["origin"].link for result in client.poll(0.1)]
    assert links == ["", "wrist_2", "forearm", "wrist_1"]


def test_a_decision_that_has_waited_for_another_does_not_hang(
    scripted: tuple[ExecutorClient, ScriptedExecutor],
) -> None:
    client, process = scripted
    client.start("a", TOLD, 0.0)
    client.start("a", TOLD, 0.0)
    process.report("oldest")
    assert len(client.poll(1.9)) == 1
    assert client.poll(3.8) == []
    (late,) = client.poll(4.0)
    assert "hangs" in late["reason"]


def test_an_executor_that_keeps_dying_is_started_once_a_second(
    scripted: tuple[ExecutorClient, ScriptedExecutor],
) -> None:
    client, _ = scripted
    now, before = client._started, ScriptedExecutor.started
    for second in range(3):
        running: Any = client._process
        running.kill()
        for later in (0.1, 0.5, 0.9):
            client.poll(now + second * 1.1 + later)
        assert ScriptedExecutor.started == before + second
        client.poll(now + (second + 1) * 1.1)
        client.poll(now + (second + 1) * 1.1 + 0.05)
        assert ScriptedExecutor.started == before + second + 1


def test_one_that_hangs_again_is_told_again(scripted: tuple[ExecutorClient, ScriptedExecutor]) -> None:
    client, process = scripted
    for now in (10.0, 20.0):
        client.start("a", TOLD, now)
        (late,) = client.poll(now + 2.1)
        assert late["reason"] == "hangs: no result after 2 s"
        assert late["took"] == pytest.approx(2.1)
        process.report("oldest")
        assert [result["ok"] for result in client.poll(now + 2.2)] == [True]


def test_what_one_that_died_has_left_is_not_taken_for_the_next_one(
    scripted: tuple[ExecutorClient, ScriptedExecutor],
) -> None:
    """Half a line, and decisions that nobody reports any more."""
    client, process = scripted
    now = client._started
    client.start("a", TOLD, now)
    assert [result["reason"] for result in client.poll(now + 2.1)] == ["hangs: no result after 2 s"]
    process.say_bytes(b'{"action": "a", "ok": tr')
    client.poll(now + 2.1)
    process.kill()
    assert [result["reason"] for result in client.poll(now + 2.2)] == ["the executor's process died"]
    client.poll(now + 2.3)
    following: Any = client._process
    assert client.poll(now + 9.0) == []
    client.start("a", {**TOLD, "link": "wrist_1"}, now + 9.0)
    assert [result["reason"] for result in client.poll(now + 11.1)] == ["hangs: no result after 2 s"]
    following.report("oldest")
    assert [result["origin"].link for result in client.poll(now + 11.2)] == ["wrist_1"]


def test_a_program_is_killed_once_though_a_later_decision_was_skipped(
    scripted: tuple[ExecutorClient, ScriptedExecutor], monkeypatch: pytest.MonkeyPatch
) -> None:
    killed: list[int] = []
    monkeypatch.setattr(f"{MODULE}.kill_group", killed.append)
    client, process = scripted
    now = client._started
    client.start("a", TOLD, now)
    process.say({"action": "a", "group": 12345})
    client.start("a", TOLD, now)
    process.report("newest", False)
    client.poll(now)
    process.kill()
    client.poll(now + 0.1)
    assert killed == [12345]
    client.poll(now + 1.1)  # the next one, whose end is no end of that program
    client.close()
    assert killed == [12345]


def test_one_that_takes_nothing_holds_up_nobody(scripted: tuple[ExecutorClient, ScriptedExecutor]) -> None:
    client, process = scripted
    refusals = [client.start("a", TOLD, 0.0) for _ in range(PIPE // 50)]
    assert refusals[0] == ""
    assert refusals[-1] == "the executor's process does not take it"
    assert client._process is process


def test_one_that_takes_a_part_of_a_decision_is_started_again(
    scripted: tuple[ExecutorClient, ScriptedExecutor],
) -> None:
    """It could not read what follows. What it was doing is reported, too."""
    client, process = scripted
    now = client._started
    assert client.start("a", TOLD, now) == ""
    assert client.start("a", {**TOLD, "rule": 2 * PIPE * "x"}, now + 0.3) == (
        "the executor's process does not take it"
    )
    assert process.ended == ["killed"]
    assert "not running" in client.start("a", TOLD, now + 0.4)
    (lost,) = client.poll(now + 0.5)
    assert (lost["ok"], lost["origin"], lost["took"]) == (False, ("arm", "forearm"), pytest.approx(0.3))
    assert client.poll(now + 1.1) == []
    assert client.start("a", TOLD, now + 1.2) == ""


def test_it_is_told_to_end_before_it_is_killed(scripted: tuple[ExecutorClient, ScriptedExecutor]) -> None:
    """An action that is connected to the robot disconnects then."""
    client, process = scripted
    client.close()
    assert process.ended == ["told", "killed"]


def test_without_actions_there_is_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(POPEN, ScriptedExecutor)
    before = ScriptedExecutor.started
    client = ExecutorClient({}, HOST)
    assert client.poll(time.monotonic() + 10.0) == []
    client.close()
    assert ScriptedExecutor.started == before


@pytest.mark.parametrize("starts", [True, False])
def test_an_executor_that_cannot_be_started_is_tried_again(
    monkeypatch: pytest.MonkeyPatch, starts: bool
) -> None:
    """The computer is out of processes or memory, or ends the process at once."""

    class Refused(ScriptedExecutor):
        def __init__(self, *_: object, **__: object) -> None:
            if not starts:
                raise BlockingIOError(11, "Resource temporarily unavailable")
            super().__init__()
            read, write = os.pipe()
            os.close(read)
            self.stdin.close()
            self.stdin = os.fdopen(write, "wb", 0)

    monkeypatch.setattr(POPEN, Refused)
    client = ExecutorClient({"a": CommandAction(type="command", command=("true",))}, HOST)
    try:
        now = time.monotonic()
        assert "not running" in client.start("a", TOLD, now)
        assert client.poll(now + 1.1) == []
        assert "not running" in client.start("a", TOLD, now + 1.2)
        monkeypatch.setattr(POPEN, ScriptedExecutor)
        client.poll(now + 2.2)
        assert client.start("a", TOLD, now + 2.3) == ""
    finally:
        client.close()
