"""The pipeline's side of the executor: never waits for it, and restarts it when it dies."""

import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from contactsense.service.reactions.actions.base import ExecutedAction
from contactsense.service.reactions.actions.child_group import kill_group
from contactsense.service.reactions.decision import Origin

MODULE = "contactsense.service.reactions.executor"
RESTART = 1.0
"""Shortest time between two starts [s]."""
_GRACE = 1.0
"""Time beyond an action's own timeout after which it counts as hanging [s]."""
_END = 1.0
"""Time that the executor has to end what its actions have started, before it is killed [s]."""
_MAX_LINE = 1 << 16


@dataclass(slots=True)
class _Begun:
    """A decision that an action was given and has not reported yet."""

    since: float
    """When it began, or when the one before it was done [s]."""
    origin: Origin


class ExecutorClient:
    """Passes decisions to the executor's process and receives their results.

    Args:
        actions: Name -> action.
        host: Address of the robot's controller.
    """

    def __init__(self, actions: Mapping[str, ExecutedAction], host: str) -> None:
        self._actions = dict(actions)
        setup = {
            "host": host,
            "actions": {name: action.model_dump(mode="json") for name, action in actions.items()},
        }
        self._setup = json.dumps(setup).encode() + b"\n"
        self._process: subprocess.Popen[bytes] | None = None
        self._started = -RESTART
        self._rest = b""
        self._begun: dict[str, list[_Begun]] = {name: [] for name in actions}
        self._hung: set[str] = set()
        self._left: list[dict[str, Any]] = []  # results for the next poll
        self._groups: dict[str, int] = {}  # of programs that run: nothing else ends them if the executor dies
        if actions:
            self._start(time.monotonic())

    @property
    def pid(self) -> int | None:
        """Process id of the executor."""
        return None if self._process is None else self._process.pid

    def start(self, action: str, decision: dict[str, Any], now: float) -> str:
        """Start an action; returns why it cannot be started, empty if it can."""
        task = json.dumps({"action": action, "decision": decision}).encode() + b"\n"
        if self._process is None or self._process.stdin is None:
            return "the executor's process is not running; it is being restarted"
        try:
            written = os.write(self._process.stdin.fileno(), task)
        except BlockingIOError:
            return "the executor's process does not take it"
        except OSError:
            return "the executor's process has died"
        if written != len(task):  # a partial line: the executor could not parse what follows
            self._left = self._all_lost("the executor's process was ended, as it took too little", now)
            self._end()
            return "the executor's process does not take it"
        self._begun[action].append(_Begun(now, Origin(decision.get("rule", ""), decision.get("link", ""))))
        return ""

    def poll(self, now: float) -> list[dict[str, Any]]:
        """Return the results that have arrived: `action`, `ok`, `reason`, `took` [s], of a decision or of the
        action's preparation; `origin`, an `Origin`."""
        if not self._actions:
            return []
        results, self._left = self._left, []
        if self._process is None:
            if now - self._started >= RESTART:
                self._start(now)
            return results
        assert self._process.stdout is not None
        try:
            chunk = os.read(self._process.stdout.fileno(), _MAX_LINE)
        except BlockingIOError:
            chunk = None
        if chunk == b"":
            results += self._all_lost("the executor's process died", now)
            self._end()
        elif chunk is not None:
            for result in self._lines(chunk):
                results.append(result)
                self._take(result, now)
        return results + self._overdue(now)

    def _lines(self, chunk: bytes) -> list[dict[str, Any]]:
        """Return the results in what has arrived, and note which programs run."""
        *lines, self._rest = (self._rest + chunk).split(b"\n")
        results = []
        for message in map(json.loads, lines):
            if "group" in message:
                self._groups[message["action"]] = message["group"]
                continue
            results.append(message)
            if message["task"] == "oldest":
                self._groups.pop(message["action"], None)
        return results

    def _take(self, result: dict[str, Any], now: float) -> None:
        """Note which decision needs no more waiting, see `contactsense.service.reactions.executor.Task`, and
        whose result this is."""
        begun = self._begun[result["action"]]
        result["origin"] = Origin()
        if begun and result["task"] != "none":
            result["origin"] = begun.pop(0 if result["task"] == "oldest" else -1).origin
        if result["task"] == "oldest":
            self._hung.discard(result["action"])
            for waited in begun[:1]:
                waited.since = now

    def _overdue(self, now: float) -> list[dict[str, Any]]:
        found = []
        for name, begun in self._begun.items():
            limit = self._actions[name].timeout + _GRACE
            if begun and name not in self._hung and now - begun[0].since > limit:
                self._hung.add(name)
                found.append(self._lost(name, f"hangs: no result after {limit:g} s", now))
        return found

    def _all_lost(self, reason: str, now: float) -> list[dict[str, Any]]:
        return [self._lost(name, reason, now) for name, begun in self._begun.items() if begun]

    def _lost(self, name: str, reason: str, now: float) -> dict[str, Any]:
        """The result of an action that has reported none."""
        oldest = self._begun[name][0]
        return {
            "action": name, "ok": False, "reason": reason, "took": now - oldest.since,
            "origin": oldest.origin,
        }  # fmt: skip

    def _start(self, now: float) -> None:
        self._started = now
        # -P: do not import from a folder named contactsense in the user's working directory.
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", MODULE],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                bufsize=0,
            )
            assert self._process.stdin is not None
            assert self._process.stdout is not None
            os.write(self._process.stdin.fileno(), self._setup)
        except OSError:  # no process or memory left, or it died at once: `poll` starts it again
            self._end()
            return
        os.set_blocking(self._process.stdin.fileno(), False)
        os.set_blocking(self._process.stdout.fileno(), False)

    def _end(self) -> None:
        """Kill the process, and the programs that its actions have started."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._read_rest()
            for pipe in (self._process.stdin, self._process.stdout):
                if pipe is not None:
                    pipe.close()
        for group in self._groups.values():
            kill_group(group)
        self._groups.clear()
        self._process = None
        self._rest = b""
        self._begun = {name: [] for name in self._actions}
        self._hung.clear()

    def _read_rest(self) -> None:
        """Read what the executor wrote last: a program may have started since the latest `poll`."""
        assert self._process is not None
        if self._process.stdout is not None:
            with contextlib.suppress(OSError, ValueError):
                while chunk := os.read(self._process.stdout.fileno(), _MAX_LINE):
                    self._lines(chunk)

    def close(self) -> None:
        """End the process. It ends what its actions have started; it is killed if that takes too long."""
        if self._process is not None and self._process.stdin is not None:
            self._process.stdin.close()
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(_END)
        self._end()
