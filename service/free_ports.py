"""Whether ports can be listened on, and in words why not."""

import contextlib
import os
import socket
from collections.abc import Iterable
from typing import NamedTuple


class Wanted(NamedTuple):
    """A port that is to be opened."""

    option: str
    """The option with which the user chooses it."""
    port: int
    """0: any free one."""
    kind: socket.SocketKind = socket.SOCK_STREAM


class PortError(ValueError):
    """A port cannot be opened; the text states which and why."""


def reason(error: OSError) -> str:
    """Why an address cannot be listened at. Python appends the address to this, as it stands in the code."""
    if error.errno is None or error.errno < 0:  # an unknown host; the system has no words for its number
        return (error.strerror or str(error)).partition(" (while attempting")[0]
    return os.strerror(error.errno)


def check(host: str, ports: Iterable[Wanted]) -> None:
    """Check that ports can be open at the same time.

    Raises:
        PortError: One of them cannot.
    """
    with contextlib.ExitStack() as opened:
        for option, port, kind in ports:
            try:
                if kind == socket.SOCK_STREAM:
                    opened.enter_context(socket.create_server((host, port)))
                else:
                    opened.enter_context(socket.socket(socket.AF_INET, kind)).bind((host, port))
            except OSError as error:
                raise PortError(f"{option}: cannot listen at {host}:{port}: {reason(error)}") from None
