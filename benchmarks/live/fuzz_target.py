"""Description of a parser for fuzzing."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Target:
    """A parser, the errors it may raise, and well-formed inputs to corrupt."""

    name: str
    parse: Callable[[bytes], object]
    refuses: type[Exception] | tuple[type[Exception], ...]
    """Its own error; any other exception is a defect."""
    seeds: tuple[bytes, ...]
