"""Base classes of all actions."""

import contextlib
import socket
import urllib.error
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from typing import Annotated, Any

from pydantic import ConfigDict, Field

from contactsense.robots.file_model import FileModel

Port = Annotated[int, Field(ge=1, le=65535)]


class ActionError(RuntimeError):
    """An action failed; the message states what was expected and what was received."""


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
    """Open a TCP connection; every problem with it is raised as an `ActionError`."""
    where = f"{host}:{port}"
    try:
        with socket.create_connection((host, port), timeout) as opened:
            opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            yield opened
    except TimeoutError:
        raise ActionError(f"{where}: no answer within {timeout:g} s") from None
    except OSError as error:
        raise ActionError(f"{where}: {error.strerror or error}") from None


def no_answer(error: Exception, timeout: float) -> str:
    """Why an HTTP request has no answer, in the words of `connection`."""
    cause = error.reason if isinstance(error, urllib.error.URLError) else error
    if isinstance(cause, TimeoutError):
        return f"no answer within {timeout:g} s"
    return (cause.strerror if isinstance(cause, OSError) else None) or str(cause)
