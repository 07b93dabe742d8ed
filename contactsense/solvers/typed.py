"""`robots.compiled.kernel` with a type that sees through it: what is compiled keeps its signature."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from robots.compiled import kernel as _kernel

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile `function` as `robots.compiled.kernel` does."""
    return cast(F, _kernel(function))
