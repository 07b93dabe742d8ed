"""Progress of the pipeline's process while it compiles and loads kernels."""

import json
from collections.abc import Callable

from contactsense.robots.jit.compilation import CompilationProgress

OnLoading = Callable[[CompilationProgress], None]


class Loading:
    """What the process has reported about its compilation.

    Args:
        on_loading: Called with each progress.
        share: Completed fraction at the start.
    """

    def __init__(self, on_loading: OnLoading | None, share: float = 0.0) -> None:
        self._on_loading = on_loading
        self.share = share
        """Completed fraction, 0 to 1."""
        self.left: float | None = None
        """Estimated remaining time [s]; None while nothing is compiled."""
        self.advanced: float | None = None
        """Time of the latest progress, on the event loop's clock [s]; None before the first."""

    def begin(self) -> None:
        """A process starts."""
        self.share, self.left, self.advanced = 0.0, None, None

    def take(self, payload: bytes, now: float) -> None:
        """Store a report of the process, which arrived at `now` [s]."""
        progress = CompilationProgress(**json.loads(payload))
        if self.advanced is None or progress.share > self.share:
            self.advanced = now
        if progress.share > self.share:
            self.share, self.left = progress
            if self._on_loading is not None:
                self._on_loading(progress)

    def end(self) -> None:
        """Everything is loaded, or the process has ended."""
        compiling = 0.0 < self.share < 1.0
        self.share, self.left, self.advanced = 1.0, None, None
        if compiling and self._on_loading is not None:
            self._on_loading(CompilationProgress(1.0, 0.0))

    def __str__(self) -> str:
        """Progress in words; empty while nothing is compiled."""
        if not 0.0 < self.share < 1.0 or self.left is None:
            return ""
        return str(CompilationProgress(self.share, self.left))
