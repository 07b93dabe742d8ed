"""Signals that reach the whole process group, such as Ctrl-C or the stop of a service manager."""

import os
import signal
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import FrameType
from typing import Any


def leave_to_parent() -> None:
    """Ignore SIGINT, and SIGTERM while the parent lives: it shuts this process down in order, and would take
    an earlier end for a failure.

    The end of the parent must end this process by other means, such as the end of their connection. SIGTERM
    ends a process that has not noticed it.
    """
    parent = os.getppid()

    def handle(number: int, frame: FrameType | None) -> None:
        if os.getppid() != parent:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, handle)


@contextmanager
def ignored(*numbers: signal.Signals) -> Iterator[None]:
    """Ignore these signals in this block, as do processes that it starts. Without effect in a thread other
    than the main one, which cannot set it."""
    with _handled(dict.fromkeys(numbers, signal.SIG_IGN)):
        yield


@contextmanager
def never_lost(*numbers: signal.Signals) -> Iterator[None]:
    """Have these signals raise a KeyboardInterrupt, in this block or, if it gets lost there, after it.

    An exception that is raised while compiled code calls back may be dropped by that code. Signals that are
    ignored already remain so. Without effect in a thread other than the main one.
    """
    noted = threading.Event()

    def end(*_: object) -> None:
        noted.set()
        raise KeyboardInterrupt

    with _handled({number: end for number in numbers if signal.getsignal(number) is not signal.SIG_IGN}):
        yield
    if noted.is_set():
        raise KeyboardInterrupt


@contextmanager
def _handled(handlers: Mapping[signal.Signals, Any]) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
