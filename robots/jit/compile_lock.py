"""Several processes that need the same machine code compile it once: the others wait, and load it from the
cache.

Without this, two services that start on a new machine at the same time, the workers of an analysis, or those
that run the tests, would each compile every kernel.
"""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from contactsense.robots.files.file_lock import lock

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
            held = lock(files.enter_context(path.open("w")), patience)
        yield held
