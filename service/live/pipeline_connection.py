"""The connection between the pipeline's process and the service, from the side of the process: messages out,
commands in. Neither waits while the pipeline runs.

Messages that the service does not read in time wait in a bounded outbox; when it is full, the oldest are
dropped and counted.
"""

import json
import select
import socket
import struct
import time
from collections import deque
from collections.abc import Callable
from typing import Any

HEAD = struct.Struct("<cdI")
"""Header of each message: kind, time of the sample [s], number of bytes that follow."""
ESTIMATE, HEALTH, LOADING, LAST_WORDS, REPORT = b"E", b"H", b"C", b"L", b"R"
"""Kinds of messages: an estimate, the health of sensors and process, the progress of the compilation, the
error that ends the process, a report of a listener."""
_OUTBOX = 1000
"""Messages that wait for the service at most: two seconds of estimates."""
_MAX_COMMAND = 1 << 20
"""Largest command of the service [bytes]."""


class Outbox:
    """Sends messages over a socket without waiting for it, except for the last ones."""

    def __init__(self, connection: socket.socket, size: int = _OUTBOX) -> None:
        connection.setblocking(False)
        self._connection = connection
        self._size = size
        self._waiting: deque[bytes] = deque()
        self._begun = memoryview(b"")  # rest of a partly sent message
        self.dropped = 0
        """Number of dropped messages."""

    def post(self, kind: bytes, t: float, payload: bytes) -> None:
        """Send a message, or keep it until the socket accepts it. Estimates are dropped first.

        Raises:
            OSError: The other end has been closed.
        """
        if len(self._waiting) >= self._size:
            oldest = next((i for i, waiting in enumerate(self._waiting) if waiting[:1] == ESTIMATE), 0)
            del self._waiting[oldest]
            self.dropped += 1
        self._waiting.append(HEAD.pack(kind, t, len(payload)) + payload)
        self.flush()

    def flush(self) -> None:
        """Send as much as the socket accepts now."""
        while self._begun or self._waiting:
            if not self._begun:
                self._begun = memoryview(self._waiting.popleft())
            try:
                self._begun = self._begun[self._connection.send(self._begun) :]
            except BlockingIOError:
                return

    def finish(self, patience: float) -> None:
        """Send all that waits; gives up after `patience` seconds.

        Raises:
            OSError: The other end has been closed.
        """
        deadline = time.monotonic() + patience
        poller = select.poll()
        poller.register(self._connection, select.POLLOUT)
        self.flush()
        while self._begun and (left := deadline - time.monotonic()) > 0.0:
            poller.poll(left * 1e3)
            self.flush()


class Inbox:
    """Receives commands from the service: one JSON object per line.

    Args:
        connection: Connection to the service; it does not block.
        refuse: Called with the reason for each command that is left out.
    """

    def __init__(self, connection: socket.socket, refuse: Callable[[str], None]) -> None:
        self._connection = connection
        self._refuse = refuse
        self._rest = b""

    def take(self) -> list[dict[str, Any]]:
        """Return the commands that have arrived; does not wait.

        Raises:
            OSError: The service has closed the connection.
        """
        try:
            chunk = self._connection.recv(1 << 16)
        except BlockingIOError:
            return []
        if not chunk:
            raise BrokenPipeError
        *lines, rest = (self._rest + chunk).split(b"\n")
        self._rest = rest[: _MAX_COMMAND + 1]  # enough to show that the command is too long
        return [json.loads(line) for line in lines if self._accepts(line)]

    def _accepts(self, line: bytes) -> bool:
        if len(line) <= _MAX_COMMAND:
            return True
        begin = line[:40].decode(errors="replace")
        self._refuse(f"command {begin}...: expected at most {_MAX_COMMAND} bytes, got more; it is left out")
        return False
