"""The executor's process: what it does with more decisions than it can carry out, and how it is scheduled."""

import os
import sys
import time
from pathlib import Path

import pytest

from contactsense.service.reactions.actions.command import CommandAction
from contactsense.service.reactions.executor import QUEUE
from contactsense.service.reactions.executor_client import ExecutorClient
from tests.service.live.test_scheduling import in_a_thread, permitted
from tests.service.loopback import until
from tests.service.reactions.test_executor_client import HOST, TOLD, results_of


def test_the_newest_decision_is_skipped_where_too_many_wait(tmp_path: Path) -> None:
    """The others are carried out in their order, each with the time that it took itself."""
    begun, go_on = tmp_path / "begun", tmp_path / "go on"
    script = f"touch '{begun}'; until test -e '{go_on}'; do sleep 0.02; done"
    client = ExecutorClient(
        {"a": CommandAction(type="command", command=("sh", "-c", script), timeout=60.0)}, HOST
    )
    try:
        links = [f"link {number}" for number in range(QUEUE + 2)]
        client.start("a", {**TOLD, "link": links[0]}, time.monotonic())
        assert until(begun.exists)
        for link in links[1:]:
            client.start("a", {**TOLD, "link": link}, time.monotonic())
        (skipped,) = results_of(client, 1)
        assert (skipped["ok"], skipped["reason"]) == (
            False,
            f"skipped: {QUEUE} decisions already wait for it",
        )
        assert (skipped["origin"].link, skipped["took"]) == (links[-1], 0.0)
        waited = time.monotonic()
        go_on.touch()
        done = results_of(client, QUEUE + 1)
        assert [(result["ok"], result["origin"].link) for result in done] == [
            (True, link) for link in links[:-1]
        ]
        assert all(0.0 < result["took"] < time.monotonic() - waited for result in done[1:])
    finally:
        client.close()


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has it")
@pytest.mark.skipif(not permitted(), reason="this user may not run anything in real time")
def test_a_program_does_not_run_in_real_time_though_the_pipeline_does() -> None:
    """One that computes would keep the rest of the computer from running."""
    status = "import os, sys; sys.exit(os.sched_getscheduler(0))"
    action = CommandAction(type="command", command=(sys.executable, "-c", status), timeout=60.0)

    def start() -> ExecutorClient:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        return ExecutorClient({"a": action}, HOST)

    client = in_a_thread(start)
    assert isinstance(client, ExecutorClient)
    try:
        client.start("a", TOLD, time.monotonic())
        assert [result["reason"] for result in results_of(client, 1)] == [f"exit status {os.SCHED_OTHER}"]
    finally:
        client.close()
