"""A program and its children: one process group, which another thread can end."""

import os
import signal
import subprocess
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress

from contactsense.service.reactions.actions.base import ActionError

_ONCE_TOLD = ("/bin/sh", "-c", 'read -r told && exec "$@"', "sh")
"""Becomes the program that follows once it reads the end of a line; ends if nobody is left to write it."""


class ChildGroup:
    """Starts one program at a time.

    Args:
        tell: Called with the number of the process group of each program that starts.
    """

    def __init__(self, tell: Callable[[int], None] | None = None) -> None:
        self._tell = tell
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._closed = False

    def start(self, command: Sequence[str]) -> "subprocess.Popen[bytes]":
        """Start a program in a process group of its own. It begins after its group has been told: if this
        process is killed before, nobody could end it.

        Raises:
            ActionError: It cannot be started, or the group is closed.
        """
        # `close` waits here: it must not miss a program that is just being started.
        with self._lock:
            if self._closed:
                raise ActionError(f"{command[0]}: not started, as the service ends or loads other rules")
            try:
                self._process = subprocess.Popen(
                    [*_ONCE_TOLD, *command],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.PIPE,
                    start_new_session=True,
                )
            except OSError as error:
                raise ActionError(f"{command[0]}: {error.strerror or error}") from None
            if self._tell is not None:
                self._tell(self._process.pid)
            assert self._process.stdin is not None
            with suppress(BrokenPipeError):  # something has killed it; its exit status says so
                self._process.stdin.write(b"\n")
                self._process.stdin.flush()
            return self._process

    def kill(self) -> None:
        """Kill the program that runs, with its children."""
        with self._lock:
            self._kill()

    def release(self) -> None:
        """The program has ended: its number may be given to another one."""
        with self._lock:
            self._process = None

    def close(self) -> None:
        """Kill what runs, and start nothing any more."""
        with self._lock:
            self._closed = True
            self._kill()

    def _kill(self) -> None:
        if self._process is not None:
            kill_group(self._process.pid)


def kill_group(group: int) -> None:
    """Kill all processes of a group; nothing happens if there are none."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(group, signal.SIGKILL)
