"""Shows the first compilation of the kernels: a bar on a terminal, one line that is updated in a notebook."""

import contextlib
import sys
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from rich.console import Console, RenderableType
from rich.progress import BarColumn, Progress, TextColumn

from contactsense.robots.jit.compilation import Compilation, CompilationProgress

Notify = Callable[[CompilationProgress], object]


@contextlib.contextmanager
def shown_compilation(roots: Iterable[Any], progress: bool | Notify | None = None) -> Iterator[Compilation]:
    """Show the compilation that happens inside the `with` block; nothing if nothing is compiled.

    Args:
        roots: Compiled functions that Python calls.
        progress: A function is called with the progress instead. True: shown on stderr; False: not shown;
            None: shown if stderr is a terminal or the program is a notebook.
    """
    if callable(progress):
        with Compilation(roots, progress) as compilation:
            yield compilation
        return
    console = Console(stderr=True)
    if not (console.is_terminal or console.is_jupyter if progress is None else progress):
        with Compilation(roots) as compilation:
            yield compilation
        return
    display = _Line() if console.is_jupyter else CompilationBar(console)
    with Compilation(roots, display.update) as compilation:
        display.source = compilation
        try:
            yield compilation
        finally:
            display.close()


class CompilationBar:
    """A progress bar with the time left, from the first `update` on."""

    def __init__(self, console: Console) -> None:
        """`console`: where it is shown; if that is not a terminal, each update is one line."""
        self.source: Compilation | None = None
        """Called to get the progress between updates, if set."""
        self._console = console
        self._bar: _Bar | None = None
        self._last = CompilationProgress(0.0, 0.0)
        self._printed = -1

    def update(self, progress: CompilationProgress) -> None:
        """Show this progress; the fraction 1 removes the bar."""
        self._last = progress
        if progress.share >= 1.0:
            self.close()
        elif not self._console.is_terminal:
            step = int(10.0 * progress.share)
            if step > self._printed:
                self._printed = step
                self._console.print(str(progress), highlight=False)
        elif self._bar is None:
            self._bar = _Bar(self._console, self._now)
            self._bar.start()

    def close(self) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def _now(self) -> CompilationProgress:
        return self._last if self.source is None else self.source.progress


class _Bar(Progress):
    """Reads the progress each time it is drawn."""

    def __init__(self, console: Console, now: Callable[[], CompilationProgress]) -> None:
        super().__init__(
            TextColumn("compiling kernels, once per installation"),
            BarColumn(),
            TextColumn("{task.percentage:.0f} %, about {task.fields[left]:.0f} s left"),
            console=console,
            transient=True,
            refresh_per_second=4,
        )
        self._now = now
        self._only = self.add_task("", total=1.0, left=now().left)

    def get_renderables(self) -> Iterable[RenderableType]:
        """The elements to draw."""
        for task in self.tasks:
            now = self._now()
            self.update(task.id, completed=now.share, left=now.left)
        yield from super().get_renderables()


class _Line:
    """One line of a notebook's output that is overwritten."""

    def __init__(self) -> None:
        self.source: Compilation | None = None
        self._length = 0

    def update(self, progress: CompilationProgress) -> None:
        """Show this progress."""
        text = str(progress)
        print("\r" + text.ljust(self._length), end="", file=sys.stderr, flush=True)
        self._length = len(text)

    def close(self) -> None:
        """Clear the line."""
        if self._length:
            print("\r" + " " * self._length + "\r", end="", file=sys.stderr, flush=True)
