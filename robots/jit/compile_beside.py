"""A second process compiles a kernel that a first compilation needs, while this one compiles the others.

A compilation follows the calls, one function after the other, and uses one processor. The locks of the
kernels see to it that each is compiled by one process: whichever comes second loads it from the cache. So the
second process changes nothing but the time; where it fails, this one compiles all by itself.
"""

import os
import pickle
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numba
from numba.core import event

from contactsense.robots.files.file_lock import AVAILABLE
from contactsense.robots.jit.compilation import COMPILE_EVENT, elsewhere, is_cached, name_of
from contactsense.robots.jit.kernel import Kernel

_PROGRAM = """
import pickle, sys
sys.path[:] = pickle.load(sys.stdin.buffer)
from contactsense.robots.jit.compile_beside import compile_as_told
compile_as_told()
"""


@contextmanager
def compiled_beside(root: Any, part: Any, *arguments: Any) -> Iterator[None]:
    """Have `part` compiled by another process as soon as `root` is compiled inside the `with` block.

    Nothing is done where `root` is loaded from the cache, or where there is one processor, no cache or no
    lock.

    Args:
        root: The kernel that is compiled here, and calls `part`.
        part: A kernel that `root` does not call first.
        arguments: Examples of its arguments, of the types with which `root` calls it.
    """
    if not (isinstance(root, Kernel) and isinstance(part, Kernel) and _is_possible()):
        yield
        return
    second = _SecondProcess(root, part, arguments)
    elsewhere.add(name_of(part))
    event.register(COMPILE_EVENT, second)  # type: ignore[no-untyped-call]
    try:
        yield
    finally:
        event.unregister(COMPILE_EVENT, second)  # type: ignore[no-untyped-call]
        elsewhere.discard(name_of(part))
        second.close()


def compile_as_told() -> None:
    """Compile the kernel that the first process names on standard input."""
    module, name, types = pickle.load(sys.stdin.buffer)
    __import__(module)
    getattr(sys.modules[module], name).called_by_kernels.compile(types)


def _is_possible() -> bool:
    affinity = getattr(os, "sched_getaffinity", None)  # which macOS lacks
    processors = len(affinity(0)) if affinity is not None else os.cpu_count() or 1
    # The executable of a program that contains Python is no interpreter.
    is_interpreter = Path(sys.executable or "").name.lower().startswith("python")
    return processors > 1 and AVAILABLE and is_interpreter


class _SecondProcess(event.Listener):
    """Starts the process when Numba begins to compile `root`."""

    def __init__(self, root: Any, part: Any, arguments: tuple[Any, ...]) -> None:
        self._root, self._part, self._arguments = root, part, arguments
        self._process: subprocess.Popen[bytes] | None = None

    def on_start(self, event: Any) -> None:
        """Numba begins to compile a function."""
        if event.data["dispatcher"] is self._root and self._process is None:
            variant = self._part.called_by_kernels
            if not is_cached(variant) and getattr(variant._cache, "_cache_file", None) is not None:
                with suppress(OSError):
                    self._start()

    def on_end(self, event: Any) -> None:
        """Numba has compiled a function."""

    def _start(self) -> None:
        function = self._part.py_func
        types = tuple(numba.typeof(argument) for argument in self._arguments)  # type: ignore[no-untyped-call]
        self._process = subprocess.Popen(
            [sys.executable, "-c", _PROGRAM],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        assert self._process.stdin is not None
        with self._process.stdin as told:
            told.write(pickle.dumps(sys.path))
            told.write(pickle.dumps((function.__module__, function.__name__, types)))

    def close(self) -> None:
        """End the process; usually it has ended."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
