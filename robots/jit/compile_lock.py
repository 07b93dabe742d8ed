"""Several processes that need the same machine code compile it once: the others wait, and load it from the
cache.

Without this, two services that start on a new machine at the same time, the workers of an analysis, or those
that run the tests, would each compile every kernel.
"""

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO

try:
    import fcntl
except ImportError:  # pragma: no cover: no such locks on Windows
    fcntl = None  # type: ignore[assignment]

AVAILABLE = fcntl is not None
"""Whether this system has such locks."""
POLL = 0.05
"""Time between two attempts to get the lock [s]."""
PATIENCE = 300.0
"""A process that waits for longer compiles by itself [s]: the other one may have been stopped. No kernel
takes a quarter of that."""


@contextmanager
def compile_lock(path: Path, patience: float = PATIENCE) -> Iterator[bool]:
    """Hold a file lock, unless that is not possible or takes too long.

    The operating system releases the lock of a process that ends. The file stays: a process that removed it
    would let two others lock two files.

    Args:
        path: File of the lock; created.
        patience: Longest time to wait [s].

    Returns:
        Whether the lock is held.
    """
    with ExitStack() as files:
        held = False
        with suppress(OSError):
            held = _locked(files.enter_context(path.open("w")), patience)
        yield held


def _locked(file: IO[str], patience: float) -> bool:
    """Try to lock an open file for that time [s]; returns whether it is locked. Raises OSError where the file
    system has no locks."""
    if fcntl is None:
        return False
    end = time.monotonic() + patience
    while True:
        with suppress(BlockingIOError):
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        if time.monotonic() >= end:
            return False
        time.sleep(POLL)
