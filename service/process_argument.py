"""A large argument of a process that is started, such as a scene, sent over its connection.

Arguments of `multiprocessing` go through a pipe of which the parent keeps both ends until they are written.
Where they exceed the pipe's buffer, `start` waits for the process to read them, in an event loop too; and
forever if that process has been killed.
"""

import pickle
import socket
import struct
from typing import Any

_SIZE = struct.Struct("<Q")


def packed(argument: Any) -> bytes:
    """What `receive` turns into the argument again: the first bytes of a connection."""
    content = pickle.dumps(argument)
    return _SIZE.pack(len(content)) + content


def receive(connection: socket.socket) -> Any:
    """The argument; waits for it. What follows remains in the connection.

    Raises:
        ConnectionResetError: The parent has closed the connection.
    """
    (size,) = _SIZE.unpack(_exactly(connection, _SIZE.size))
    return pickle.loads(_exactly(connection, size))


def _exactly(connection: socket.socket, size: int) -> bytes:
    content = bytearray()
    while len(content) < size:
        chunk = connection.recv(size - len(content))
        if not chunk:
            raise ConnectionResetError
        content += chunk
    return bytes(content)
