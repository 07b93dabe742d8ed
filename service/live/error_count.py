"""Exceptions that must not end what goes on: they are counted, and the latest is told."""

import contextlib
from collections.abc import Callable, Iterator


class ErrorCount:
    """Counts exceptions.

    Args:
        on_error: Called with the text of each, while it is being handled.
    """

    def __init__(self, on_error: Callable[[str], None] | None = None) -> None:
        self._on_error = on_error
        self.count = 0
        """Number of errors so far."""
        self.last = ""
        """The latest of them, as text."""

    def add(self, text: str) -> None:
        """Count an error that is no exception."""
        self.count += 1
        self.last = text
        if self._on_error is not None:
            self._on_error(text)

    @contextlib.contextmanager
    def catching(self, what: str) -> Iterator[None]:
        """Count an exception inside the `with` block; `what`: where it comes from."""
        try:
            yield
        except Exception as error:
            self.add(f"{what}: {type(error).__name__}: {error}")
