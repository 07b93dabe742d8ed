"""A decision, and servers that a test scripts, to which an action can connect."""

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from contactsense.service.reactions.decision import Decision

HOST = "127.0.0.1"
DECISION = Decision(
    "arm", "collision", "begin", ("stop",), 1.5, 0.97, 4, "forearm", 3, (0.1, 0.0, 0.0), (0.5, 0.0, 0.4),
    (0.0, -60.0, 0.0), 60.0,
)  # fmt: skip
TOLD = DECISION.as_dict()


@contextmanager
def line_server(greeting: bytes, answers: bytes | None) -> Iterator[tuple[int, list[bytes]]]:
    """A TCP server that greets, notes what comes, and answers the first bytes; None: never."""
    listener = socket.create_server((HOST, 0))
    heard: list[bytes] = []

    def serve() -> None:
        with suppress(OSError):
            connection, _ = listener.accept()
            with connection:
                connection.sendall(greeting)
                while chunk := connection.recv(4096):
                    heard.append(chunk)
                    if answers is not None:
                        connection.sendall(answers)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield listener.getsockname()[1], heard
    finally:
        listener.shutdown(socket.SHUT_RDWR)
        listener.close()
        thread.join(5.0)


@contextmanager
def dripping(line: bytes, begin: bytes = b"") -> Iterator[int]:
    """A server that sends `begin`, then `line` again and again, one byte every 20 ms; yields its port."""

    def drip(listener: socket.socket) -> None:
        with suppress(OSError):
            while True:
                peer, _ = listener.accept()
                with peer, suppress(OSError):
                    peer.sendall(begin)
                    for i in range(1000):
                        peer.sendall(line[i % len(line) :][:1])
                        time.sleep(0.02)

    with socket.create_server((HOST, 0)) as server:
        threading.Thread(target=drip, args=(server,), daemon=True).start()
        yield server.getsockname()[1]
        server.shutdown(socket.SHUT_RDWR)
