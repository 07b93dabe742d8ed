"""Addresses that the service names can be opened, and its connections send each message at once."""

import socket
from pathlib import Path

from contactsense.service.cli.serve import listen, pages


def test_accepted_connections_send_without_delay() -> None:
    with listen("127.0.0.1", 0) as listener, socket.create_connection(listener.getsockname()):
        connection, _ = listener.accept()
        with connection:
            assert connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY) != 0


def test_the_addresses_that_are_named_can_be_opened() -> None:
    assert pages("https://0.0.0.0:8000", Path("my token")) == (
        "interface: https://127.0.0.1:8000/docs; "
        "viewer: contactsense view --url https://127.0.0.1:8000 --token-file 'my token'"
    )
    assert pages("http://192.0.2.1:80", None).endswith("view --url http://192.0.2.1:80")
