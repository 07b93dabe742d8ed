"""Who has the machine: tests that measure in real time have it to themselves, all others share it."""

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def machine(folder: Path, *, alone: bool) -> Iterator[None]:
    """Hold the machine for the length of a `with` block, shared or alone, among all processes of a test run.

    Args:
        folder: A folder that all processes of the test run know.
        alone: Wait until no other test runs, and let none begin.
    """
    # Whoever waits to be alone keeps the queue closed, or the others would never all be done.
    with (folder / "queue.lock").open("w") as queue, (folder / "machine.lock").open("w") as held:
        fcntl.flock(queue, fcntl.LOCK_EX)
        fcntl.flock(held, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        fcntl.flock(queue, fcntl.LOCK_UN)
        yield
