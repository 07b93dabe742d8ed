"""What a fuzzer needs to know of a parser."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Target:
    """A parser, what it may raise, and well-formed inputs to spoil."""

    name: str
    parse: Callable[[bytes], object]
    refuses: type[Exception] | tuple[type[Exception], ...]
    """Its own error; any other exception is a defect."""
    seeds: tuple[bytes, ...]
