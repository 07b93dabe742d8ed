"""The executor's process from the pipeline's side."""

import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from contactsense.service.reactions import executor
from contactsense.service.reactions.actions.base import ActionError
from contactsense.service.reactions.actions.command import CommandAction
from contactsense.service.reactions.executor_client import ExecutorClient
from tests.service.loopback import until

HOST = "127.0.0.1"
TOLD = {"rule": "arm", "level": "collision", "link": "forearm"}


def results_of(client: ExecutorClient, count: int, timeout: float = 20.0) -> list[dict[str, Any]]:
    results: list[dict[str, Any]] = []

    def enough() -> bool:
        results.extend(client.poll(time.monotonic()))
        return len(results) >= count

    assert until(enough, timeout), results
    return results


def test_an_action_that_hangs_holds_up_no_other(tmp_path: Path) -> None:
    go_on = tmp_path / "go on"
    script = f"until test -e '{go_on}'; do sleep 0.05; done"
    slow = CommandAction(type="command", command=("sh", "-c", script), timeout=600.0)
    # What it prints is no result.
    quick = CommandAction(type="command", command=("echo", "done"), timeout=30.0)
    client = ExecutorClient({"slow": slow, "quick": quick}, HOST)
    try:
        now = time.monotonic()
        assert client.start("slow", TOLD, now) == ""
        assert client.start("quick", TOLD, now) == ""
        (first,) = results_of(client, 1)
        assert (first["action"], first["ok"]) == ("quick", True)
        go_on.touch()
        (second,) = results_of(client, 1)
        assert (second["action"], second["ok"]) == ("slow", True)
    finally:
        client.close()


def test_a_program_that_has_ended_is_not_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its number may belong to another process by then."""
    killed: list[int] = []
    for module in ("executor_client", "actions.child_group"):
        monkeypatch.setattr(f"contactsense.service.reactions.{module}.kill_group", killed.append)
    action = CommandAction(type="command", command=("true",), timeout=30.0)
    client = ExecutorClient({"a": action}, HOST)
    try:
        assert client.start("a", TOLD, time.monotonic()) == ""
        assert results_of(client, 1)[0]["ok"]
    finally:
        client.close()
    action.open(lambda _: None)
    action.perform(TOLD, HOST)
    action.close()
    assert killed == []


def test_an_action_that_takes_too_long_is_killed() -> None:
    client = ExecutorClient({"a": CommandAction(type="command", command=("sleep", "60"), timeout=0.5)}, HOST)
    try:
        client.start("a", TOLD, time.monotonic())
        # An executor that has not started after 1.5 s is reported first, as one that hangs.
        told: list[tuple[bool, str]] = []

        def killed() -> bool:
            told.extend((result["ok"], result["reason"]) for result in results_of(client, 1))
            return (False, "sleep: killed after 0.5 s") in told

        assert until(killed, 60.0), told
    finally:
        client.close()


def test_an_executor_that_dies_is_told_and_started_again() -> None:
    sleeping = CommandAction(type="command", command=("sleep", "60"), timeout=60.0)
    client = ExecutorClient({"a": sleeping}, HOST)
    try:
        client.start("a", TOLD, time.monotonic())
        pid = client.pid
        assert pid is not None
        os.kill(pid, 9)
        (result,) = results_of(client, 1)
        assert (result["ok"], result["reason"]) == (False, "the executor's process died")
        assert result["origin"] == ("arm", "forearm")

        def again() -> bool:
            client.poll(time.monotonic())
            return client.pid not in (None, pid)

        assert until(again)
    finally:
        client.close()


def alive(pid: int) -> bool:
    """Whether a process runs; one that has ended and waits for its parent does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


@pytest.fixture
def running(tmp_path: Path) -> Iterator[tuple[ExecutorClient, int, int]]:
    """A client whose action runs: a program, with a child that it waits for."""
    note = tmp_path / "processes"
    # It gets the decision once the executor has told the client that it runs.
    script = f"cat > /dev/null; sleep 60 & echo $$ $! > '{note}.new'; mv '{note}.new' '{note}'; wait"
    action = CommandAction(type="command", command=("sh", "-c", script), timeout=60.0)
    client = ExecutorClient({"a": action}, HOST)
    try:
        assert client.start("a", TOLD, time.monotonic()) == ""
        assert until(note.exists)
        program, child = map(int, note.read_text().split())
        assert alive(program)
        assert alive(child)
        yield client, program, child
    finally:
        client.close()


def test_what_runs_ends_with_the_client(running: tuple[ExecutorClient, int, int]) -> None:
    """As when the service ends or reads its rules again."""
    client, *processes = running
    client.close()
    assert until(lambda: not any(map(alive, processes)), 10.0)


def test_an_executor_that_hangs_and_what_it_runs_end_with_the_client(
    running: tuple[ExecutorClient, int, int],
) -> None:
    client, *processes = running
    assert client.pid is not None
    os.kill(client.pid, signal.SIGSTOP)
    client.close()
    assert until(lambda: not any(map(alive, processes)), 10.0)


def test_what_runs_ends_with_an_executor_that_is_killed(running: tuple[ExecutorClient, int, int]) -> None:
    client, *processes = running
    pid = client.pid
    assert pid is not None
    os.kill(pid, signal.SIGKILL)
    results_of(client, 1)
    assert until(lambda: not any(map(alive, processes)), 10.0)


def test_a_program_does_not_begin_if_the_executor_is_killed_before_its_group_is_told(tmp_path: Path) -> None:
    """Nothing could end it."""
    begun, note = tmp_path / "begun", tmp_path / "group"
    script = (
        "import os, pathlib, sys\n"
        "from contactsense.service.reactions.actions.child_group import ChildGroup\n"
        "def tell(group):\n"
        "    pathlib.Path(sys.argv[1]).write_text(str(group))\n"
        "    os.kill(os.getpid(), 9)\n"
        "ChildGroup(tell).start(['touch', sys.argv[2]])\n"
    )
    killed = subprocess.run([sys.executable, "-c", script, str(note), str(begun)], timeout=60.0)
    assert killed.returncode == -signal.SIGKILL
    assert until(lambda: not alive(int(note.read_text())), 10.0)
    assert not begun.exists()


def test_what_runs_ends_with_the_process_that_has_the_client(
    running: tuple[ExecutorClient, int, int],
) -> None:
    """The executor reads the end of its input, as when the pipeline's process is killed."""
    client, *processes = running
    executor_process: Any = client._process
    executor_process.stdin.close()
    assert until(lambda: not any(map(alive, processes)), 10.0)


def test_nothing_is_started_any_more_while_the_executor_ends() -> None:
    action = CommandAction(type="command", command=("true",))
    action.open(lambda group: None)
    action.close()
    with pytest.raises(ActionError, match="true: not started, as the service ends"):
        action.perform(TOLD, HOST)


def test_an_executor_that_hangs_is_told() -> None:
    client = ExecutorClient({"a": CommandAction(type="command", command=("true",), timeout=0.1)}, HOST)
    try:
        pid = client.pid
        assert pid is not None
        os.kill(pid, 19)  # SIGSTOP
        begin = time.monotonic()
        client.start("a", TOLD, begin)
        (result,) = results_of(client, 1)
        assert "hangs: no result after 1.1 s" in result["reason"]
    finally:
        client.close()


def test_a_preparation_that_fails_ends_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    class Fails(CommandAction):
        def prepare(self, host: str) -> None:
            raise OSError(11, "Resource temporarily unavailable")

    reported: list[tuple[bool, str, str]] = []

    def report(_: str, ok: bool, reason: str, took: float, task: str) -> None:
        reported.append((ok, reason, task))

    monkeypatch.setattr(executor, "_report", report)
    waiting: queue.Queue[dict[str, Any]] = queue.Queue()
    action = Fails(type="command", command=("true",), timeout=30.0)
    threading.Thread(target=executor._work, args=("a", action, HOST, waiting), daemon=True).start()
    waiting.put(TOLD)
    assert until(lambda: len(reported) == 2)
    ok, why, about = reported[0]
    assert (ok, about) == (False, "none")
    assert why == "BlockingIOError: [Errno 11] Resource temporarily unavailable"
    assert reported[1] == (True, "exit status 0", "oldest")
