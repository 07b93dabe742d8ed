"""Signals that reach the whole process group, such as Ctrl-C or the stop of a service manager."""

import os
import signal
from types import FrameType


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
