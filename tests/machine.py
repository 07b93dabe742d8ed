"""Who has the machine: tests that measure in real time have it to themselves, all others share it."""

import fcntl
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

STARVED = 0.05
"""Share of the processors' time beyond which a test in real time says nothing about the code: one of
two cores is gone for a tenth of each second."""
_TIMES = 8
"""Number of times in /proc/stat that are read; the last one is the stolen time (proc(5))."""


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


class StolenTime:
    """How much of the processors' time the host of a virtual machine gave to others, since this was made."""

    def __init__(self) -> None:
        self._before = _processor_times()

    @property
    def share(self) -> float:
        """Stolen time over all time, 0 to 1; 0 where the system does not tell."""
        passed = [now - before for now, before in zip(_processor_times(), self._before, strict=True)]
        return passed[-1] / sum(passed) if sum(passed) > 0 else 0.0


def _processor_times() -> list[int]:
    """User, nice, system, idle, I/O wait, interrupts, soft interrupts and stolen time, of all processors."""
    try:
        fields = Path("/proc/stat").read_text().split("\n", 1)[0].split()
    except OSError:
        return [0] * _TIMES
    return [int(value) for value in fields[1 : 1 + _TIMES]]


def wait_for_processor(patience: float) -> None:
    """Wait until the host gives the processors for a second, at most `patience` [s]."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        stolen = StolenTime()
        time.sleep(1.0)
        if stolen.share < STARVED:
            return
