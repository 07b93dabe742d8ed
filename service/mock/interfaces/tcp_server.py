"""A TCP server of the mock: one thread, any number of clients; passes received bytes on as they arrive."""

import selectors
import socket
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress

_MOST_BACKLOG = 1 << 20
"""Largest number of bytes that wait for a client; beyond it the client is disconnected."""


class Connection:
    """One connected client."""

    def __init__(self, link: socket.socket) -> None:
        self.link = link
        self.rest = bytearray()
        """Received bytes that have not been processed."""
        self.backlog = bytearray()
        """Bytes that wait to be sent."""
        self.closing = False
        """Set to close the connection once everything is sent."""

    def send(self, data: bytes) -> None:
        """Send as much as the client accepts; the rest waits."""
        self.backlog += data
        with suppress(BlockingIOError):
            del self.backlog[: self.link.send(self.backlog)]


class TcpServer(ABC):
    """Serves clients until `close`.

    Args:
        host: Address to listen on.
        port: Port; 0: any free port, see `port`.
        period: Time between two calls of `tick` [s].
    """

    def __init__(self, host: str, port: int, period: float = 0.1) -> None:
        self.host = host
        self._listener = socket.create_server((host, port), backlog=16)
        self._listener.setblocking(False)
        self.port: int = self._listener.getsockname()[1]
        """Port that clients connect to."""
        self._period = period
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._listener, selectors.EVENT_READ)
        self.connections: list[Connection] = []
        """Connected clients; use only in the server's own thread."""
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"mock-port-{self.port}", daemon=True)

    @abstractmethod
    def greet(self, connection: Connection) -> None:
        """Called when a client has connected."""

    @abstractmethod
    def receive(self, connection: Connection, data: bytes) -> None:
        """Called when bytes have arrived from a client."""

    def tick(self) -> None:  # noqa: B027
        """Called once per period; does nothing by default, as not every server sends periodically."""

    def start(self) -> None:
        """Start to serve clients."""
        self._thread.start()

    def close(self) -> None:
        """Disconnect all clients and stop."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join(5.0)
        for connection in self.connections:
            connection.link.close()
        self._listener.close()
        self._selector.close()

    def _run(self) -> None:
        due = time.monotonic()
        while not self._stopping.is_set():
            for key, _ in self._selector.select(max(0.0, min(due - time.monotonic(), 0.1))):
                if key.data is None:
                    self._accept()
                else:
                    self._read(key.data)
            if time.monotonic() >= due:
                due += self._period
                for connection in list(self.connections):
                    self._guarded(connection, lambda connection: connection.send(b""))
                self.tick()

    def send_all(self, data: bytes) -> None:
        """Send data to every client."""
        for connection in list(self.connections):
            self._guarded(connection, lambda connection: connection.send(data))

    def _accept(self) -> None:
        with suppress(OSError):
            link, _ = self._listener.accept()
            link.setblocking(False)
            link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            connection = Connection(link)
            self.connections.append(connection)
            self._selector.register(link, selectors.EVENT_READ, connection)
            self._guarded(connection, self.greet)

    def _read(self, connection: Connection) -> None:
        try:
            data = connection.link.recv(1 << 16)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._forget(connection)
            return
        self._guarded(connection, lambda connection: self.receive(connection, data))

    def _guarded(self, connection: Connection, action: Callable[[Connection], None]) -> None:
        try:
            action(connection)
        except OSError:
            self._forget(connection)
            return
        done = connection.closing and not connection.backlog
        if done or len(connection.backlog) > _MOST_BACKLOG:
            self._forget(connection)

    def _forget(self, connection: Connection) -> None:
        if connection in self.connections:
            self.connections.remove(connection)
            self._selector.unregister(connection.link)
            connection.link.close()
