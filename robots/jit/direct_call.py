"""Calls of a kernel from Python for arguments of known types.

With each call, Numba's dispatcher finds out the types of all arguments to choose the machine code; for ten
arguments that takes as long as the dynamics of an arm. Where the types are always the same, the machine code
is chosen once.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

R = TypeVar("R")


def direct_call(compiled: Callable[..., R], *arguments: Any) -> Callable[..., R]:
    """The machine code of a kernel for arguments of these types, compiled or loaded if it is not yet.

    Numbers are converted as Python converts them, and a wrong number of arguments raises a TypeError. But of
    an array only the size of its items is checked: the caller sees to it that its data type and number of
    axes are those of the example, and that it is contiguous where the example is.

    Args:
        compiled: A kernel; with `NUMBA_DISABLE_JIT=1` a function, which is returned as it is.
        arguments: Examples of its arguments.
    """
    if not hasattr(compiled, "compile"):
        return compiled
    types = tuple(numba.typeof(argument) for argument in arguments)  # type: ignore[no-untyped-call]
    return cast(Callable[..., R], compiled.compile(types))
