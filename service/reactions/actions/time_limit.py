"""A time limit for all that is read from sockets together."""

import socket
import threading
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Self

_POLL = 0.1
"""Time between two attempts to end what exceeds its time [s]."""


class TimeLimit:
    """Ends the connections of one action: the time limit of a socket is for each packet, and a peer that
    sends a byte now and then would prolong it for ever.

    Args:
        timeout: Time limit [s].
        sockets: Returns the sockets that are open now; None for one that is not connected yet.
    """

    def __init__(self, timeout: float, sockets: Callable[[], Iterable[socket.socket | None]]) -> None:
        self._timeout, self._sockets = timeout, sockets
        self._done = threading.Event()
        self.expired = False
        """Whether the time was exceeded: what was read since is cut off."""

    def __enter__(self) -> Self:
        threading.Thread(target=self._watch, name="time limit", daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()

    def _watch(self) -> None:
        while not self._done.wait(_POLL if self.expired else self._timeout):
            self.expired = True
            for opened in self._sockets():
                if opened is not None:
                    with suppress(OSError):  # it has ended by itself
                        # Not that of a TLS socket, which takes away what the other thread reads with.
                        socket.socket.shutdown(opened, socket.SHUT_RDWR)
