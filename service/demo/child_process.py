"""Runs `contactsense` commands in child processes: starts them, waits until they are ready, ends them."""

import contextlib
import select
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from typing import IO

PATIENCE = 5.0
"""Time that a child has to end after the request [s]."""
START = 60.0
"""Time limit for starting [s]."""


class ChildError(RuntimeError):
    """A child did not start, or ended too early; the text includes its last output."""


class Child:
    """A running `contactsense` command."""

    def __init__(self, arguments: tuple[str, ...], errors: IO[bytes]) -> None:
        """Start the command. `errors`: a file for its stderr."""
        self._name = arguments[0]
        self._errors = errors
        # A new session, so that Ctrl-C reaches only this process, which ends the children in order.
        # -P: do not import from a folder named service in the user's working directory.
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "contactsense", *arguments],
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            start_new_session=True,
        )

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def wait_for(self, beginning: str) -> str:
        """Wait for a line on stdout with this beginning; returns the rest of the line.

        Raises:
            ChildError: The command ended before, or took too long.
        """
        stdout = self._process.stdout
        assert stdout is not None
        deadline = time.monotonic() + START
        while select.select([stdout], [], [], max(0.0, deadline - time.monotonic()))[0]:
            line = stdout.readline()
            if not line:
                self._process.wait(PATIENCE)
                break
            if line.startswith(beginning):
                return line[len(beginning) :].strip()
        self.check()
        raise ChildError(f"`contactsense {self._name}` is not ready after {START:g} s: {self._last_words()}")

    def check(self) -> None:
        """Check that the command runs.

        Raises:
            ChildError: The command has ended.
        """
        status = self._process.poll()
        if status is not None:
            raise ChildError(
                f"`contactsense {self._name}` ended with exit status {status}: {self._last_words()}"
            )

    def end(self) -> None:
        """Ask the command to end; kill it if it does not."""
        self._process.terminate()
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()

    def _last_words(self) -> str:
        self._errors.seek(0)
        lines = self._errors.read().decode(errors="replace").strip().splitlines()
        return lines[-1] if lines else "no message"


@contextlib.contextmanager
def child(*arguments: str) -> Iterator[Child]:
    """Run a `contactsense` command with these arguments while the context is open."""
    with tempfile.TemporaryFile() as errors:
        started = Child(arguments, errors)
        try:
            yield started
        finally:
            started.end()
