"""Commands of ours in processes of their own: started, waited for until they are ready, ended in order."""

import contextlib
import select
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from typing import IO

PATIENCE = 5.0
"""Time to end after being asked to [s]."""
START = 60.0
"""Time to come up [s]."""


class ChildError(RuntimeError):
    """A child did not come up, or ended too early; with its last words."""


class Child:
    """A running `contactsense` command."""

    def __init__(self, arguments: tuple[str, ...], errors: IO[bytes]) -> None:
        """`errors`: a file for what it writes to stderr."""
        self._name = arguments[0]
        self._errors = errors
        # A session of its own: Ctrl-C is for us, we end the children in order. -P: a folder named service
        # where the user happens to be is not ours.
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "contactsense.service", *arguments],
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            start_new_session=True,
        )

    @property
    def pid(self) -> int:
        """Number of its process."""
        return self._process.pid

    def wait_for(self, beginning: str) -> str:
        """The rest of the first line on stdout that begins so.

        Raises:
            ChildError: It ended before, or took too long.
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
        """Make sure that it runs.

        Raises:
            ChildError: It does not.
        """
        status = self._process.poll()
        if status is not None:
            raise ChildError(
                f"`contactsense {self._name}` ended with exit status {status}: {self._last_words()}"
            )

    def end(self) -> None:
        """Ask it to end, and make it."""
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
    """A `contactsense` command with these arguments, for as long as the context lasts."""
    with tempfile.TemporaryFile() as errors:
        started = Child(arguments, errors)
        try:
            yield started
        finally:
            started.end()
