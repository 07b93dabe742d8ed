"""The receive buffer of UDP sockets that a library has opened and keeps to itself.

Datagrams that arrive while a process has no processor wait in its socket's buffer; what does not fit is
lost. The system's default holds about a quarter of a second of readings at 1 kHz: Linux charges for each the
memory that it occupies, 832 bytes and more for one of 36.
"""

import os
import socket
import stat
from contextlib import suppress

SIZE = 4 * 2**20
"""Size to ask for [bytes]. Linux grants twice that, 10 s of readings at 1 kHz over loopback, but no more than
twice net.core.rmem_max."""
_DESCRIPTORS = "/dev/fd"
"""Folder with the descriptors of this process; Windows has none."""


def enlarge(peer: tuple[str, int], size: int = SIZE) -> int:
    """Enlarge the receive buffers of this process's UDP sockets that are connected to a peer. Raises nothing:
    sockets that cannot be found keep the system's default.

    Args:
        peer: IPv4 address and port that they are connected to.
        size: Size to ask for [bytes]; a larger buffer stays as it is.

    Returns:
        The smallest size that the system reports for one of them afterwards [bytes]; 0: none was found.
    """
    granted = []
    for descriptor in _descriptors():
        # The library may close it at any moment, so the rest is done with a copy.
        with suppress(OSError):
            if stat.S_ISSOCK(os.fstat(descriptor).st_mode):
                with socket.socket(fileno=os.dup(descriptor)) as copy:
                    if _is_connected_to(copy, peer):
                        granted.append(_enlarged(copy, size))
    return min(granted, default=0)


def _descriptors() -> list[int]:
    try:
        return [int(name) for name in os.listdir(_DESCRIPTORS)]
    except OSError:
        return []


def _is_connected_to(found: socket.socket, peer: tuple[str, int]) -> bool:
    # Other sockets may have no peer, which is an error.
    return (found.family, found.type) == (socket.AF_INET, socket.SOCK_DGRAM) and found.getpeername() == peer


def _enlarged(found: socket.socket, size: int) -> int:
    if found.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) < size:
        found.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, size)
    return found.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
