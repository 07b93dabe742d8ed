"""`kernel`: how all compiled functions of this project are made.

Numba keeps machine code on disk and tells by the source file of a function whether it is stale, but the
functions that it calls from other files are compiled into it. `kernel` makes the stamp cover those files too,
so that editing or updating one file never leaves old code at work in another. Numbers that a kernel uses as
global constants belong in its own file; a test sees to that.
"""

import os
from collections.abc import Callable
from typing import Any

from numba import njit

_FILES: dict[Any, frozenset[str]] = {}
"""Compiled function -> its source file and those of all compiled functions that it calls."""


def kernel(function: Callable[..., Any]) -> Any:
    """Compile `function` on first use, with division by zero as in IEEE 754, and keep the machine code on
    disk.

    Where no place for the cache is writable, the function is compiled anew in each process. `NUMBA_CACHE_DIR`
    names another place, `NUMBA_DISABLE_JIT=1` leaves plain Python for debugging.
    """
    try:
        compiled = njit(cache=True, error_model="numpy")(function)
    except RuntimeError:
        return njit(error_model="numpy")(function)
    if compiled is function:
        return compiled
    called = (function.__globals__.get(name) for name in function.__code__.co_names)
    files = frozenset({function.__code__.co_filename}).union(*(_files(value) for value in called))
    _FILES[compiled] = files
    # Numba offers no public way to widen the stamp; it compares it for equality with the one in its index
    # file.
    compiled._cache._cache_file._source_stamp = tuple((path, *_stamp(path)) for path in sorted(files))
    return compiled


def _files(value: object) -> frozenset[str]:
    return _FILES.get(value, frozenset()) if callable(value) else frozenset()


def _stamp(path: str) -> tuple[float, int]:
    status = os.stat(path)
    return status.st_mtime, status.st_size
