"""Progress of the first compilation of the kernels, and its remaining time.

Numba reports each function that it compiles, but not functions whose machine code is loaded from disk. The
remaining functions are found by following the calls from the functions that Python calls, down to those in
the cache. Each is weighted by its compile time in `compile_times.yaml` (`python -m
contactsense.benchmarks.live.compile_times`); the speed of this machine is estimated during compilation.
"""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from numba.core import event

from contactsense.robots.jit.kernel import VARIANT, Kernel

COMPILE_EVENT = "numba:compile"
"""Numba's name of the compilation of a function."""
elsewhere: set[str] = set()
"""Names of functions that another process compiles, see `contactsense.robots.jit.compile_beside`."""
_TIMES = Path(__file__).with_name("compile_times.yaml")
_PACKAGE = "contactsense."
_PRIOR = 5.0
"""The observed speed has a weight of one half after this much of the measured time [s]."""
_UNFINISHED = 0.95
"""Maximum fraction of a function's time that counts before it is finished."""


class CompilationProgress(NamedTuple):
    """State of a compilation."""

    share: float
    """Fraction of the work that is done, 0 to 1."""
    left: float
    """Estimated time left [s]."""

    def __str__(self) -> str:
        """The same as readable text."""
        return f"compiling kernels: {100.0 * self.share:.0f} %, about {self.left:.0f} s left"


@dataclass(slots=True)
class _Frame:
    """A function that is being compiled."""

    name: str
    weight: float
    """Its measured time [s]."""
    resumed: float
    """Time on the clock since which it has been the innermost one [s]."""
    spent: float = 0.0
    """Time spent on it before that, without the functions that it calls [s]."""


class Compilation(event.Listener):
    """Follows the compilation that happens inside its `with` block.

    During that time, `progress` may be read from any thread.
    """

    def __init__(
        self,
        roots: Iterable[Any],
        notify: Callable[[CompilationProgress], object] | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        """Initialize; nothing is read or computed before a function is compiled.

        Args:
            roots: Compiled functions that Python calls.
            notify: Called in the compiling thread whenever the compilation of a function begins or ends, and
                with the fraction 1 at the end.
            clock: Returns the time [s].
        """
        self._roots = tuple(roots)
        self._notify = notify
        self._clock = clock
        self._stack: list[_Frame] = []
        self._expected: dict[str, list[float]] | None = None
        self._total = self._done = self._measured = self._spent = self._share = 0.0
        self.times: list[tuple[str, float]] = []
        """Each compiled function and its own compile time [s], in order."""

    @property
    def active(self) -> bool:
        """Whether any function had to be compiled."""
        return self._expected is not None

    @property
    def progress(self) -> CompilationProgress:
        """The current state; the fraction never decreases."""
        if self._total == 0.0:
            return CompilationProgress(0.0, 0.0)
        now, slowness = self._clock(), (self._spent + _PRIOR) / (self._measured + _PRIOR)
        frames = list(self._stack)
        done = self._done
        for frame in frames:
            spent = frame.spent + (now - frame.resumed if frame is frames[-1] else 0.0)
            done += min(spent / slowness, _UNFINISHED * frame.weight)
        self._share = max(self._share, min(done / self._total, 1.0))
        return CompilationProgress(self._share, slowness * self._total * (1.0 - self._share))

    def __enter__(self) -> "Compilation":
        event.register(COMPILE_EVENT, self)  # type: ignore[no-untyped-call]
        return self

    def __exit__(self, *_: object) -> None:
        event.unregister(COMPILE_EVENT, self)  # type: ignore[no-untyped-call]
        if self.active:
            self._share = 1.0
            self._report()

    def on_start(self, event: Any) -> None:
        """Numba begins to compile a function."""
        if self._expected is None:
            self._expected = uncached(self._roots)
            self._total = sum(sum(weights) for weights in self._expected.values())
        now, name = self._clock(), name_of(event.data["dispatcher"])
        if self._stack:
            self._stack[-1].spent += now - self._stack[-1].resumed
        weights = self._expected.get(name)
        self._stack.append(_Frame(name, weights.pop(0) if weights else 0.0, now))
        self._report()

    def on_end(self, event: Any) -> None:
        """Numba has compiled a function, or failed to."""
        if not self._stack:
            return  # started before we listened
        now, frame = self._clock(), self._stack.pop()
        frame.spent += now - frame.resumed
        if self._stack:
            self._stack[-1].resumed = now
        self._done += frame.weight
        if frame.weight:
            self._measured += frame.weight
            self._spent += frame.spent
        self.times.append((frame.name, frame.spent))
        self._report()

    def _report(self) -> None:
        if self._notify is not None and self._total > 0.0:
            self._notify(self.progress)


def name_of(compiled: Any) -> str:
    """Name of a compiled function in the table of compile times."""
    function = compiled.py_func
    return f"{function.__module__.removeprefix(_PACKAGE)}.{function.__qualname__.removesuffix(VARIANT)}"


def uncached(roots: Iterable[Any]) -> dict[str, list[float]]:
    """Measured compile times [s] of each version of all functions that `roots` need and that are not in the
    cache, nor compiled elsewhere; the median of all for functions that have not been measured."""
    table: dict[str, list[float]] = yaml.safe_load(_TIMES.read_text(encoding="utf-8"))
    times = sorted(seconds for versions in table.values() for seconds in versions)
    usual = times[len(times) // 2]
    expected: dict[str, list[float]] = {}
    waiting = list(roots)
    while waiting:
        compiled = waiting.pop()
        if not hasattr(compiled, "py_func"):
            continue
        if (name := name_of(compiled)) in expected or name in elsewhere:
            continue
        versions = table.get(name, [usual])[_cached_versions(compiled) :]
        expected[name] = versions
        if versions:
            function = compiled.py_func
            called = [function.__globals__.get(name) for name in function.__code__.co_names]
            waiting += [value.called_by_kernels for value in called if isinstance(value, Kernel)]
    return expected


def is_cached(compiled: Any) -> bool:
    """Whether there is machine code of a function in memory or on disk."""
    return _cached_versions(compiled) > 0


def _cached_versions(compiled: Any) -> int:
    """Number of versions of a function in memory or on disk."""
    in_memory = len(compiled.overloads)
    # Numba has no public interface to inspect its cache without loading from it.
    index = getattr(compiled._cache, "_cache_file", None)
    return max(in_memory, 0 if index is None else len(index._load_index()))
