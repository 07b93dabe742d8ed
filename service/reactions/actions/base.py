"""Base classes of all actions."""

import contextlib
import socket
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from typing import Annotated, Any

from pydantic import ConfigDict, Field

from contactsense.robots.files.file_model import FileModel
from contactsense.service.reactions.actions.time_limit import TimeLimit

Port = Annotated[int, Field(ge=1, le=65535)]


class ActionError(RuntimeError):
    """An action failed; the message, one line, states what was expected and what was received."""

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


def one_line(text: str) -> str:
    """Text of others, such as a server's answer, for the log and the terminal: one line without control
    characters."""
    return "".join(c if c.isprintable() else "?" for c in " ".join(text.split()))


class ActionSettings(FileModel, ABC):
    """Settings of one action. Actions with `perform` run in the executor's process."""

    model_config = ConfigDict(use_attribute_docstrings=True)

    @abstractmethod
    def describe(self) -> str:
        """Return a short description of the action."""

    def missing(self) -> str:
        """What the action needs on this computer and does not find; empty if nothing."""
        return ""


class ExecutedAction(ActionSettings):
    """An action that may be slow: it runs in its own thread of the executor's process."""

    timeout: Annotated[float, Field(gt=0.0, le=60.0)] = 2.0
    """Time limit [s]."""

    def open(self, tell: Callable[[int], None]) -> None:
        """Called once in the executor's process, before anything else.

        Args:
            tell: To be called with the number of each process group that the action starts. If the executor
                is killed, the pipeline's process kills these groups.
        """

    def prepare(self, host: str) -> None:
        """Do in advance what can be done before the action is needed; `host` is the robot's controller.

        Raises:
            ActionError: The preparation failed; it is tried again when the action is needed.
        """

    @abstractmethod
    def perform(self, decision: dict[str, Any], host: str) -> str:
        """Perform the action; returns what to report.

        Raises:
            ActionError: The action failed.
        """

    def close(self) -> None:
        """Release what `prepare` acquired, and end what `perform` has started; called from another thread."""


@contextlib.contextmanager
def connection(host: str, port: int, timeout: float) -> Iterator[socket.socket]:
    """Open a TCP connection for at most `timeout` [s]; each problem with it is raised as an `ActionError`."""
    where, opened = f"{host}:{port}", list[socket.socket]()
    with TimeLimit(timeout, lambda: list(opened)) as limit:
        try:
            with socket.create_connection((host, port), timeout) as robot:
                opened.append(robot)
                if limit.expired:  # in looking up the name: nobody expects anything to be sent by now
                    raise TimeoutError
                robot.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                yield robot
                if limit.expired:  # an answer that was cut off is none
                    raise TimeoutError
        except (OSError, ActionError) as error:
            if not limit.expired and isinstance(error, ActionError):
                raise
            if not limit.expired and not isinstance(error, TimeoutError):
                raise ActionError(f"{where}: {getattr(error, 'strerror', '') or error}") from None
            raise ActionError(f"{where}: no answer within {timeout:g} s") from None
