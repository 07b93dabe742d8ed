"""Locks of open files, which the operating system releases when a process ends, however it ends."""

import time
from contextlib import suppress
from typing import IO, Any

try:
    import fcntl
except ImportError:  # pragma: no cover: no such locks on Windows
    fcntl = None  # type: ignore[assignment]

AVAILABLE = fcntl is not None
"""Whether this system has such locks."""
POLL = 0.05
"""Time between two attempts to get the lock [s]."""


def lock(file: IO[Any], patience: float = 0.0) -> bool:
    """Try to lock an open file until it is closed.

    Args:
        file: The file.
        patience: Longest time to wait for who holds the lock [s].

    Returns:
        Whether it is locked; False also where the system has no such locks.

    Raises:
        OSError: The file system has no locks.
    """
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
