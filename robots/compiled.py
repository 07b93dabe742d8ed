"""`kernel`: how all compiled functions of this project are made.

Numba keeps machine code on disk and tells by the source file of a function whether it is stale; but whatever
the function takes from other files, kernels that it calls and constants, is compiled into it. `kernel` makes
the stamp cover all of that, so that editing or updating one file never leaves old code at work in another.
"""

import hashlib
import os
import sys
from collections.abc import Callable, Iterator
from typing import Any

from numba import njit

_INGREDIENTS: dict[Any, frozenset[tuple[str, ...]]] = {}
"""Compiled function -> source files and constants that go into its machine code."""


_FUSED = frozenset({"contract", "reassoc", "nsz", "arcp"})


def kernel(function: Callable[..., Any]) -> Any:
    """Compile `function` on first use, with division by zero as in IEEE 754, and keep the machine code on
    disk.

    Where no place for the cache is writable, the function is compiled anew in each process. `NUMBA_CACHE_DIR`
    names another place, `NUMBA_DISABLE_JIT=1` leaves plain Python for debugging.
    """
    return _compile(function, frozenset())


def fused_kernel(function: Callable[..., Any]) -> Any:
    """Like `kernel`, but sums may be reordered and multiplications fused into them.

    For estimates that are statistical anyway, where the last digits mean nothing and time does. Infinities
    and NaN are honoured as ever.
    """
    return _compile(function, _FUSED)


def _compile(function: Callable[..., Any], liberties: frozenset[str]) -> Any:
    fastmath = set(liberties) if liberties else False
    try:
        compiled: Any = njit(cache=True, error_model="numpy", fastmath=fastmath)(function)
    except RuntimeError:
        return njit(error_model="numpy", fastmath=fastmath)(function)
    if compiled is function:
        return compiled
    ingredients = frozenset({("liberties", *sorted(liberties)), *_ingredients(function)})
    _INGREDIENTS[compiled] = ingredients
    # Numba offers no public way to widen the stamp. It compares this one for equality before it reads the
    # rest of
    # its index file, which may name classes that have moved since.
    stamps = repr([(*item, *_stamp(item)) for item in sorted(ingredients)])
    cache = compiled._cache._cache_file
    cache._version = f"{cache._version} {hashlib.sha256(stamps.encode()).hexdigest()}"
    return compiled


def _ingredients(function: Callable[..., Any]) -> Iterator[tuple[str, ...]]:
    yield ("file", function.__code__.co_filename)
    for name in function.__code__.co_names:
        value = function.__globals__.get(name)
        if isinstance(value, int | float | str | tuple):
            yield ("constant", name, repr(value))
        elif isinstance(value, type):
            path = getattr(sys.modules[value.__module__], "__file__", None)
            if path is not None:
                yield ("file", path)
        elif callable(value):
            yield from _INGREDIENTS.get(value, ())


def _stamp(item: tuple[str, ...]) -> tuple[float, int]:
    if item[0] != "file":
        return 0.0, 0
    status = os.stat(item[1])
    return status.st_mtime, status.st_size
