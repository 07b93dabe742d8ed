"""`kernel`: how all compiled functions of this project are made.

Numba keeps machine code on disk and tells by the source file of a function whether it is stale; but whatever
the function takes from other files, kernels that it calls and constants, is compiled into it. `kernel` makes
the stamp cover all of that, so that editing or updating one file never leaves old code at work in another.
"""

import hashlib
import os
import sys
from collections.abc import Callable
from typing import Any

import numba
from numba import njit
from numba.core.caching import IndexDataCacheFile

_FUSED = frozenset({"contract", "reassoc", "nsz", "arcp"})
_INLINED = "inlined"
_ALLOCATING = "allocating"
_SOURCES: dict[Any, tuple[Callable[..., Any], frozenset[str]]] = {}
"""Compiled function -> its source and the liberties it was compiled with."""


def kernel(function: Callable[..., Any]) -> Any:
    """Compile `function` on first use, with division by zero as in IEEE 754, and keep the machine code on
    disk.

    Where no place for the cache is writable, the function is compiled anew in each process. `NUMBA_CACHE_DIR`
    names another place, `NUMBA_DISABLE_JIT=1` leaves plain Python for debugging.

    A kernel cannot allocate: one that would, be it for `out[:] = values`, is refused when it is compiled (see
    `robots.arrays.copy` for that). Nor can it return arrays, least of all to Python. As nothing has to be
    released, compiled code keeps no count of an array's users, which saves a quarter of a sample's time; who
    calls it keeps the arrays alive meanwhile.
    """
    return _compile(function, frozenset())


def inlined_kernel(function: Callable[..., Any]) -> Any:
    """Like `kernel`, but its code becomes a part of each kernel that calls it.

    For functions that take a whole `Arm` and `Memory`: a call hands over each array as seven numbers or more,
    and with a hundred arrays that takes longer than most functions' work. Where the code is a part of its
    caller only what it uses is touched.
    """
    return _compile(function, frozenset({_INLINED}))


def fused_kernel(function: Callable[..., Any]) -> Any:
    """Like `kernel`, but sums may be reordered and multiplications fused into them.

    For estimates that are statistical anyway, where the last digits mean nothing and time does. Infinities
    and NaN are honoured as ever.
    """
    return _compile(function, _FUSED)


def inlined_fused_kernel(function: Callable[..., Any]) -> Any:
    """What `fused_kernel` and `inlined_kernel` are, in one."""
    return _compile(function, _FUSED | {_INLINED})


def allocating_kernel(function: Callable[..., Any]) -> Any:
    """Like `kernel`, but may make arrays and draw random numbers: for benchmarks and for work offline."""
    return _compile(function, frozenset({_ALLOCATING}))


def allocating_fused_kernel(function: Callable[..., Any]) -> Any:
    """What `allocating_kernel` and `fused_kernel` are, in one."""
    return _compile(function, _FUSED | {_ALLOCATING})


def no_more(compiled: Any) -> None:
    """Compile no more versions of a kernel: from now on calls with arguments of other types raise a
    TypeError, instead of holding up a stream for a minute."""
    if hasattr(compiled, "disable_compile"):
        compiled.disable_compile()


def _compile(function: Callable[..., Any], liberties: frozenset[str]) -> Any:
    options: dict[str, Any] = {
        "error_model": "numpy",
        "fastmath": set(liberties & _FUSED) or False,
        "forceinline": _INLINED in liberties,
        # Numba's run-time, which allocates and counts users.
        "_nrt": _ALLOCATING in liberties,
    }
    try:
        compiled: Any = njit(cache=True, **options)(function)
    except RuntimeError:
        return njit(**options)(function)
    if compiled is function:
        return compiled
    _SOURCES[compiled] = function, liberties
    # Numba offers no public way to widen the stamp.
    index = compiled._cache._cache_file
    index.__class__ = _Index
    index.compiled = compiled
    return compiled


class _Index(IndexDataCacheFile):
    """Numba's index of machine code on disk, with a stamp that covers all that went into the code.

    The version stands before everything else in the file and is compared before the rest is read, which may
    name classes that have moved since. It is asked for when the function is first called: by then all that it
    calls has been defined.
    """

    compiled: Any

    @property
    def _version(self) -> str:
        ingredients: set[tuple[str, ...]] = set()
        _gather(self.compiled, ingredients, set())
        stamps = repr([(*item, *_stamp(item)) for item in sorted(ingredients)])
        return f"{numba.__version__} {hashlib.sha256(stamps.encode()).hexdigest()}"

    @_version.setter
    def _version(self, numbers: str) -> None:
        """Numba's own version is part of ours."""

    def _load_index(self) -> Any:
        """What the index lists; nothing where that names a class of a caller's arguments that is gone."""
        try:
            return super()._load_index()  # type: ignore[no-untyped-call]
        except (AttributeError, ImportError):
            return {}


def _gather(compiled: Any, ingredients: set[tuple[str, ...]], seen: set[Any]) -> None:
    """Add the source files and constants that go into a function's machine code."""
    ingredients.add(("file", __file__))
    if compiled in seen:
        return
    seen.add(compiled)
    if compiled not in _SOURCES:
        # Compiled by other means, such as an overload.
        if hasattr(compiled, "__code__"):
            ingredients.add(("file", compiled.__code__.co_filename))
        return
    function, liberties = _SOURCES[compiled]
    ingredients.add(("liberties", *sorted(liberties)))
    ingredients.add(("file", function.__code__.co_filename))
    for name in function.__code__.co_names:
        value = function.__globals__.get(name)
        if isinstance(value, int | float | str | tuple):
            ingredients.add(("constant", name, repr(value)))
        elif isinstance(value, type):
            path = getattr(sys.modules[value.__module__], "__file__", None)
            if path is not None:
                ingredients.add(("file", path))
        elif callable(value):
            _gather(value, ingredients, seen)


def _stamp(item: tuple[str, ...]) -> tuple[float, int]:
    if item[0] != "file":
        return 0.0, 0
    status = os.stat(item[1])
    return status.st_mtime, status.st_size
