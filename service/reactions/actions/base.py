"""What all actions have in common."""

import contextlib
import socket
from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

Port = Annotated[int, Field(ge=1, le=65535)]


class ActionError(RuntimeError):
    """An action failed; the message says what was expected and what came."""


class ActionSettings(BaseModel, ABC):
    """Settings of one action. Those with `perform` are carried out in the executor's process."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @abstractmethod
    def describe(self) -> str:
        """What it does, in a few words."""


class ExecutedAction(ActionSettings):
    """An action that may take its time: it has a thread of its own in the executor's process."""

    timeout: Annotated[float, Field(gt=0.0, le=60.0)] = 2.0
    """Time limit [s]."""

    def prepare(self, host: str) -> None:
        """What can be done before it is needed; `host` is the robot's controller.

        Raises:
            ActionError: It failed; it is tried again when the action is needed.
        """

    @abstractmethod
    def perform(self, decision: dict[str, Any], host: str) -> str:
        """Carry it out; returns what to report.

        Raises:
            ActionError: It failed.
        """

    def close(self) -> None:
        """Release what `prepare` has taken."""


@contextlib.contextmanager
def connection(host: str, port: int, timeout: float) -> Iterator[socket.socket]:
    """A TCP connection; every trouble with it is an `ActionError`."""
    where = f"{host}:{port}"
    try:
        with socket.create_connection((host, port), timeout) as opened:
            opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            yield opened
    except TimeoutError:
        raise ActionError(f"{where}: no answer within {timeout:g} s") from None
    except OSError as error:
        raise ActionError(f"{where}: {error.strerror or error}") from None
