"""The executor: a process that performs actions that may be slow or hang.

It reads JSON lines from standard input: first the robot's address and the actions, then the tasks. It writes
one JSON line per result, and one per process group that an action starts. Each action has its own thread, so
that an action that hangs does not delay the others. The process ends, and with it all that its actions have
started, when its standard input is closed: the pipeline's process ends, or has closed it.
"""

import json
import os
import queue
import sys
import threading
import time
from functools import partial
from typing import Any, Literal

from pydantic import TypeAdapter

from contactsense.service.group_signals import leave_to_parent
from contactsense.service.reactions.actions import Action
from contactsense.service.reactions.actions.base import ActionError, ExecutedAction, one_line

QUEUE = 8
"""Maximum number of decisions that wait for one action."""


Task = Literal["oldest", "newest", "none"]
"""Which of the decisions that an action was given and has not reported yet a report is about."""


def _report(action: str, ok: bool, reason: str, took: float, task: Task) -> None:
    result = {"action": action, "ok": ok, "reason": reason, "took": round(took, 6), "task": task}
    _write(result)


def _report_group(action: str, group: int) -> None:
    _write({"action": action, "group": group})


def _write(message: dict[str, Any]) -> None:
    # One write: lines of several threads do not mix.
    os.write(sys.stdout.fileno(), json.dumps(message).encode() + b"\n")


def _work(name: str, action: ExecutedAction, host: str, waiting: "queue.Queue[dict[str, Any]]") -> None:
    try:
        action.prepare(host)
    except Exception as error:
        _report(name, False, _reason(error), 0.0, "none")
    while True:
        decision = waiting.get()
        begin = time.monotonic()
        try:
            reason, ok = one_line(action.perform(decision, host)), True
        except Exception as error:
            reason, ok = _reason(error), False
        _report(name, ok, reason, time.monotonic() - begin, "oldest")


def _reason(error: Exception) -> str:
    """Why an action failed. What it does not foresee must not end its thread: later decisions would wait for
    ever."""
    return one_line(str(error) if isinstance(error, ActionError) else f"{type(error).__name__}: {error}")


def main() -> None:
    """Run until standard input ends."""
    leave_to_parent()
    if sys.platform == "linux":  # users' commands must not inherit real-time priority
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    setup = json.loads(sys.stdin.readline())
    given: dict[str, Action] = TypeAdapter(dict[str, Action]).validate_python(setup["actions"])
    actions = {name: action for name, action in given.items() if isinstance(action, ExecutedAction)}
    queues: dict[str, queue.Queue[dict[str, Any]]] = {name: queue.Queue(QUEUE) for name in actions}
    for name, action in actions.items():
        action.open(partial(_report_group, name))
        threading.Thread(
            target=_work, args=(name, action, setup["host"], queues[name]), name=name, daemon=True
        ).start()
    for line in sys.stdin:
        task = json.loads(line)
        try:
            queues[task["action"]].put_nowait(task["decision"])
        except queue.Full:
            reason = f"skipped: {QUEUE} decisions already wait for it"
            _report(task["action"], False, reason, 0.0, "newest")
    for action in actions.values():
        action.close()
    os._exit(0)  # do not wait for threads that hang


if __name__ == "__main__":
    main()
