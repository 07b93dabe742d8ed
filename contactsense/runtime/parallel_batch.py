"""Many measurements of an arm at rest on several cores."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from queue import SimpleQueue

from contactsense.runtime.buffers import Buffers, KernelBuffers

Explain = Callable[[Buffers, slice], None]
"""Explains some rows of a batch with the buffers that it is given."""
CHUNK = 256
"""Measurements that one thread explains before it takes the next ones: milliseconds of work, so that threads
end together."""


def explain_rows(explain: Explain, rows: int, buffers: KernelBuffers, jobs: int | None) -> None:
    """Explain all rows of a batch, on `jobs` threads.

    Compiled code writes its intermediate results into its buffers, so each thread has a copy of its own. As
    no row depends on another, the results do not depend on the number of threads.

    Args:
        explain: Must be compiled and release Python's global lock.
        rows: Number of measurements.
        buffers: Constants and state; used as they are by a single thread.
        jobs: Number of threads; None: one per core.

    Raises:
        ValueError: `jobs` is not a positive number.
    """
    if jobs is not None and (isinstance(jobs, bool) or not isinstance(jobs, int) or jobs < 1):
        raise ValueError(f"jobs: expected a whole number from 1 on, or None for all cores, got {jobs!r}")
    starts = range(0, rows, CHUNK)
    threads = min(usable_cores() if jobs is None else jobs, len(starts))
    if threads <= 1:
        explain(buffers.arguments, slice(0, rows))
        return
    copies: SimpleQueue[Buffers] = SimpleQueue()
    floats, integers = buffers.arguments
    for _ in range(threads):
        copies.put((floats.copy(), integers.copy()))

    def explain_chunk(start: int) -> None:
        own = copies.get()
        try:
            explain(own, slice(start, min(start + CHUNK, rows)))
        finally:
            copies.put(own)

    with ThreadPoolExecutor(threads) as pool:
        for _ in pool.map(explain_chunk, starts):
            pass


def usable_cores() -> int:
    """Number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
