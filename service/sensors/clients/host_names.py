"""Resolves host names in a thread, because a resolver that does not answer blocks for many seconds."""

import ipaddress
import socket
import threading
import time

from contactsense.service.sensors.clients.robot_stream import SensorError

PATIENCE = 2.0
"""A lookup that takes longer than this is reported [s]."""
RETRY = 1.0
"""Time between a failed lookup and the next one [s]."""


class HostName:
    """The address of a host name, looked up again after each failure; never blocks.

    Args:
        host: A host name, or an address, which needs no lookup.
    """

    def __init__(self, host: str) -> None:
        self.host = host
        self._address: str | None = host if _is_address(host) else None
        self._error = ""
        self._began = time.monotonic()
        self._ended = -RETRY
        self._thread: threading.Thread | None = None

    def address(self) -> str | None:
        """The address; None while it is being looked up.

        Raises:
            SensorError: The name does not exist, or the resolver does not answer.
        """
        if self._address is not None:
            return self._address
        now = time.monotonic()
        busy = self._thread is not None and self._thread.is_alive()
        if not busy and now - self._ended >= RETRY:
            self._began = now
            self._thread = threading.Thread(target=self._look_up, name=f"resolve {self.host}", daemon=True)
            self._thread.start()
            busy = True
        if busy and now - self._began > PATIENCE:
            raise SensorError(
                f"the name {self.host} cannot be resolved: no answer from the resolver for "
                f"{now - self._began:.0f} s; check DNS or give the address in numbers"
            )
        if self._error:
            raise SensorError(self._error)
        return self._address

    def forget(self) -> None:
        """Look the name up again at the next call: the address may have changed."""
        if not _is_address(self.host):
            self._address = None

    def _look_up(self) -> None:
        try:
            found = socket.getaddrinfo(self.host, None, socket.AF_INET, socket.SOCK_STREAM)
            self._address, self._error = str(found[0][4][0]), ""
        except (OSError, UnicodeError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            self._error = (
                f"the name {self.host} cannot be resolved: {reason}; check DNS or give the address in numbers"
            )
        self._ended = time.monotonic()


def _is_address(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True
