"""`contactsense.robots.jit.kernel.kernel` with a type annotation that keeps the function's signature."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from contactsense.robots.jit.kernel import kernel as _kernel

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile `function` as `contactsense.robots.jit.kernel.kernel` does."""
    return cast(F, _kernel(function))
