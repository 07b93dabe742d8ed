"""Numbers separated by commas as options of commands."""

from typing import Any

import click


class Numbers(click.ParamType):  # type: ignore[type-arg]  # generic for mypy only
    """Numbers separated by commas."""

    def __init__(self, *counts: int) -> None:
        """`counts`: how many numbers are accepted; any number of them if there are none."""
        self._counts = counts
        self.name = "NUMBERS"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> list[float]:
        """The numbers; fails with one line if there are others than expected."""
        if isinstance(value, list):
            return value
        try:
            numbers = [float(part) for part in value.strip("[]() ").split(",")]
        except ValueError:
            numbers = []
        if not numbers or (self._counts and len(numbers) not in self._counts):
            count = " or ".join(str(n) for n in self._counts) or "some"
            self.fail(f"expected {count} numbers separated by commas, got {value!r}", param, ctx)
        return numbers
