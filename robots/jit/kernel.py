"""How all kernels of this project are compiled, and how their machine code is cached.

Numba caches machine code on disk and checks only the source file of the function itself. But a function's
machine code also contains the kernels that it calls and the constants that it uses from other files. `kernel`
extends the check to all of them, so that editing or updating one file never leaves stale code in use.
"""

import hashlib
import os
import sys
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar, get_args, get_type_hints

import numba
import numpy as np
from numba import njit
from numba.core.caching import IndexDataCacheFile
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature
from numba.core.types import Array, BaseTuple, unliteral

from contactsense.robots.jit import code_library, nonnegative_indices
from contactsense.robots.jit.code_library import KernelCompiler, LinkedCompiler
from contactsense.robots.jit.compile_lock import compile_lock

F = TypeVar("F", bound=Callable[..., Any])
"""A kernel keeps the signature of its function."""

_FUSED = frozenset({"contract", "reassoc", "nsz", "arcp"})
_INLINED = "inlined"
_ALLOCATING = "allocating"
_NOGIL = "nogil"
_FOR_KERNELS = "for kernels"
_GENERATED = "__generated_source__"
"""Global name under which a generated function finds its source."""
VARIANT = ".called_by_kernels"
"""Added to a function's name for `Kernel.called_by_kernels`."""
_ROOT = str(Path(__file__).parents[2])
_SOURCES: dict[Any, tuple[Callable[..., Any], frozenset[str]]] = {}
"""Compiled function -> its source and its compile options."""

if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]  # set from the environment
    # Compiled code divides by zero as in IEEE 754 and says nothing; NumPy's numbers warn.
    warnings.filterwarnings("ignore", category=RuntimeWarning, module=r"contactsense\.")


def kernel(function: F) -> F:
    """Compile `function` on first use, with division by zero as in IEEE 754, and cache the machine code on
    disk.

    Without a writable cache folder, the function is compiled anew in each process. `NUMBA_CACHE_DIR` sets the
    folder; `NUMBA_DISABLE_JIT=1` leaves plain Python for debugging.

    A kernel cannot allocate: one that would, even for `out[:] = values`, fails to compile (use
    `contactsense.robots.jit.array_views.copy` for that). Nor can it return arrays, least of all to Python. As
    nothing has to be released, compiled code does not count references to arrays, which saves a quarter of
    the time of a sample; the caller keeps the arrays alive.

    An index that is computed counts from the start and must not be negative
    (`contactsense.robots.jit.nonnegative_indices`); `NUMBA_BOUNDSCHECK=1` raises an IndexError if one is.
    """
    return _compile(function, frozenset())


def inlined_kernel(function: F) -> F:
    """Like `kernel`, but inlined into each kernel that calls it.

    For functions that take the whole `Constants` and `State`: a call passes each array as seven numbers or
    more, and with a hundred arrays that takes longer than the work of most functions. An inlined function
    accesses only the arrays that it uses.
    """
    return _compile(function, frozenset({_INLINED}))


def fused_kernel(function: F) -> F:
    """Like `kernel`, but sums may be reordered and multiplications fused into them.

    For statistical estimates, where the last digits do not matter and speed does. Infinities and NaN are
    still handled correctly.
    """
    return _compile(function, _FUSED)


def inlined_fused_kernel(function: F) -> F:
    """`fused_kernel` and `inlined_kernel` combined."""
    return _compile(function, _FUSED | {_INLINED})


def nogil_kernel(function: F) -> F:
    """Like `kernel`, but other threads run Python meanwhile: for calls that take milliseconds."""
    return _compile(function, frozenset({_NOGIL}))


def allocating_kernel(function: F) -> F:
    """Like `kernel`, but may allocate arrays and draw random numbers: for benchmarks and offline work."""
    return _compile(function, frozenset({_ALLOCATING}))


def allocating_fused_kernel(function: F) -> F:
    """`allocating_kernel` and `fused_kernel` combined."""
    return _compile(function, _FUSED | {_ALLOCATING})


def generated_kernel(name: str, source: str, names: Mapping[str, Any], module: str) -> Any:
    """An inlined kernel from generated source.

    Args:
        name: Name of the function in the source.
        source: A function definition.
        names: Values of the names that it uses.
        module: Name of the module that holds the kernel; the cache is kept beside its file.
    """
    file = sys.modules[module].__file__
    assert file is not None
    namespace = {**names, "__name__": module, _GENERATED: source}
    exec(compile(source, file, "exec"), namespace)
    return _compile(namespace[name], frozenset({_INLINED}))


def with_names(function: Callable[..., Any], **names: Any) -> FunctionType:
    """A function some of whose global names mean something else, such as a function that it calls.

    Numba cannot cache functions that take compiled functions; as a kernel, this one is cached like any other.
    """
    bound = FunctionType(function.__code__, {**function.__globals__, **names}, function.__name__)
    # Names its file in the cache.
    meanings = (f"{value.__module__}.{value.__qualname__}" for value in names.values())
    bound.__qualname__ = ".".join((function.__qualname__, *meanings))
    return bound


def in_cache(compiled: Any) -> bool:
    """Whether the machine code of a function is kept on disk: that of kernels is."""
    return compiled in _SOURCES


def loaded(compiled: Any) -> bool:
    """Whether a kernel has been called from Python: its machine code is in memory."""
    return bool(getattr(compiled, "signatures", True))


def _compile(function: F, compile_options: frozenset[str]) -> F:
    compiled = _jit(function, compile_options)
    if compiled is not function:
        compiled.__class__ = Kernel
    kept: F = compiled
    return kept


def _jit(function: Callable[..., Any], compile_options: frozenset[str]) -> Any:
    options: dict[str, Any] = {
        "error_model": "numpy",
        "fastmath": set(compile_options & _FUSED) or False,
        "forceinline": _INLINED in compile_options,
        "nogil": _NOGIL in compile_options,
        # Numba's run-time, which allocates and counts references.
        "_nrt": _ALLOCATING in compile_options,
        "no_cpython_wrapper": _FOR_KERNELS in compile_options,
        # A function pointer for other languages.
        "no_cfunc_wrapper": True,
        "pipeline_class": LinkedCompiler if _FOR_KERNELS in compile_options else KernelCompiler,
    }
    try:
        compiled: Any = njit(cache=True, **options)(function)
    except RuntimeError:
        compiled = njit(**options)(function)
    else:
        if compiled is not function:
            # Numba has no public interface to extend the check.
            index = compiled._cache._cache_file
            index.__class__ = _Index
            index.compiled = compiled
    _SOURCES[compiled] = function, compile_options
    return compiled


class _CompiledOnce(CPUDispatcher):
    """A function that is compiled by one process at a time; the next one loads it from the cache."""

    _cache: Any

    def compile(self, sig: Any) -> Any:
        """Numba calls this for each set of argument types, to compile it or to load it from the cache."""
        index = getattr(self._cache, "_cache_file", None)
        arguments, _ = normalize_signature(sig)  # type: ignore[no-untyped-call]
        if index is None or tuple(arguments) in self.overloads:
            return super().compile(sig)
        # Numba's own lock first, as one thread of this process holds it while it compiles. A function is
        # locked before those that it calls, in each process, so that no two wait for each other.
        with global_compiler_lock, compile_lock(Path(f"{index._index_path}.lock")):
            return super().compile(sig)


class Kernel(_CompiledOnce):
    """A kernel that Python can call; other kernels call a variant of it that Python cannot.

    Most kernels are called by kernels only, and half of the time of compiling them all would go into code
    that converts arguments from Python: ten seconds for a function of a hundred arrays.
    """

    _called_by_kernels: Any = None

    def add_overload(self, compiled: Any) -> None:
        """Numba calls this with new machine code, before any call of it.

        Raises:
            TypeError: Python would get an array within a tuple. Without reference counts that is the array
                whose part was meant.
        """
        function, compile_options = _SOURCES[self]
        kind = compiled.signature.return_type
        if _ALLOCATING not in compile_options and isinstance(kind, BaseTuple) and _holds_arrays(kind):
            raise TypeError(f"{function.__qualname__}: a kernel cannot return arrays to Python, got {kind}")
        super().add_overload(compiled)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Numba asks for this when a kernel that calls this one is typed.

        It would compile another version for each constant that is passed; inlining has the same effect.
        """
        args = tuple(unliteral(value) for value in args)  # type: ignore[no-untyped-call]
        kws = {name: unliteral(value) for name, value in dict(kws).items()}  # type: ignore[no-untyped-call]
        return self.called_by_kernels.get_call_template(args, kws)

    def get_overload(self, sig: Any) -> Any:
        """Numba asks for this when a call by another kernel is compiled."""
        return self.called_by_kernels.get_overload(sig)

    @property
    def called_by_kernels(self) -> Any:
        """The variant for other kernels, with its own machine code in the cache."""
        if self._called_by_kernels is None:
            function, compile_options = _SOURCES[self]
            assert isinstance(function, FunctionType)
            variant = FunctionType(
                function.__code__, function.__globals__, function.__name__, function.__defaults__
            )
            # Names its file in the cache.
            variant.__qualname__ = function.__qualname__ + VARIANT
            self._called_by_kernels = _jit(variant, compile_options | {_FOR_KERNELS})
            self._called_by_kernels.__class__ = _KernelForKernels
        return self._called_by_kernels


def _holds_arrays(kind: Any) -> bool:
    """Whether a value of this Numba type is an array or contains one."""
    parts: Any = kind if isinstance(kind, BaseTuple) else ()
    return isinstance(kind, Array) or any(_holds_arrays(part) for part in parts)


class _KernelForKernels(_CompiledOnce):
    def __call__(self, *args: Any, **kws: Any) -> Any:
        raise TypeError(f"{self.py_func.__qualname__}: expected a call by a kernel, got one by Python")


class _Index(IndexDataCacheFile):
    """Numba's index of machine code on disk, with a version that covers everything compiled into the code.

    The version precedes everything else in the file and is compared before the rest is read, which may refer
    to classes that have moved since. It is computed when the function is first called: by then all functions
    that it calls are defined.
    """

    compiled: Any

    @property
    def _version(self) -> str:
        dependencies: set[tuple[str, ...]] = set()
        _dependencies(self.compiled, dependencies, set())
        stamps = repr([(*item, *_stamp(item)) for item in sorted(dependencies)])
        return f"{numba.__version__} {hashlib.sha256(stamps.encode()).hexdigest()}"

    @_version.setter
    def _version(self, numbers: str) -> None:
        """Numba's own version is part of ours."""

    def _load_index(self) -> Any:
        """The content of the index; empty if it refers to a class that no longer exists."""
        try:
            return super()._load_index()  # type: ignore[no-untyped-call]
        except (AttributeError, ImportError):
            return {}


def _dependencies(compiled: Any, dependencies: set[tuple[str, ...]], seen: set[Any]) -> None:
    """Add the source files and constants that are compiled into a function's machine code."""
    for file in (__file__, code_library.__file__, nonnegative_indices.__file__):
        dependencies.add(("file", _relative_path(file)))
    if compiled in seen:
        return
    seen.add(compiled)
    if compiled not in _SOURCES:
        # Not compiled by `_compile`, such as an overload.
        if hasattr(compiled, "__code__"):
            dependencies.add(("file", _relative_path(compiled.__code__.co_filename)))
        return
    function, compile_options = _SOURCES[compiled]
    dependencies.add(("options", *sorted(compile_options)))
    dependencies.add(("file", _relative_path(function.__code__.co_filename)))
    if _GENERATED in function.__globals__:
        dependencies.add(("source", function.__globals__[_GENERATED]))
    for hint in get_type_hints(function).values():
        _declarations(hint, dependencies)
    for name in function.__code__.co_names:
        value = function.__globals__.get(name)
        if callable(value) and not isinstance(value, type):
            _dependencies(value, dependencies, seen)
        else:
            _add_constant(name, value, dependencies)


def _add_constant(name: str, value: object, dependencies: set[tuple[str, ...]]) -> None:
    """Add a global of a module that a function refers to: a number, an array, or a class by its file."""
    if isinstance(value, int | float | str | tuple | slice | np.dtype):
        dependencies.add(("constant", name, repr(value)))
    elif isinstance(value, np.ndarray):
        dependencies.add(("constant", name, str(value.dtype), repr(value.tolist())))
    elif isinstance(value, type):
        path = getattr(sys.modules[value.__module__], "__file__", None)
        if path is not None:
            dependencies.add(("file", _relative_path(path)))


def _declarations(hint: Any, dependencies: set[tuple[str, ...]]) -> None:
    """Add the named tuples in the type of an argument. Numba takes two of them for the same type if the types
    of their fields are, in whatever order the names; but code refers to fields by their place."""
    if hasattr(hint, "_fields"):
        item = ("fields", f"{hint.__module__}.{hint.__qualname__}", *hint._fields)
        if item not in dependencies:
            dependencies.add(item)
            for field in get_type_hints(hint).values():
                _declarations(field, dependencies)
    for part in get_args(hint):
        _declarations(part, dependencies)


def _relative_path(path: str) -> str:
    """Path of a source file; of our own files relative to the package, so that the cache stays valid when the
    installation is moved."""
    return os.path.relpath(path, _ROOT) if path.startswith(_ROOT + os.sep) else path


def _stamp(item: tuple[str, ...]) -> tuple[float, int]:
    if item[0] != "file":
        return 0.0, 0
    status = os.stat(os.path.join(_ROOT, item[1]))
    return status.st_mtime, status.st_size
