"""What is told of a force/torque sensor whose configuration page does not answer: the port that was asked."""

import http.server
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from contactsense.service.sensors.clients.netft_client import NetFtStream
from tests.service.loopback import until

RDT_PORT = 49_152


@contextmanager
def page(status: int, text: bytes) -> Iterator[int]:
    """A web server that answers every request alike; yields its port."""

    class Page(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(status)
            self.end_headers()
            self.wfile.write(text)

        def log_message(self, format: str, *args: object) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Page) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield server.server_address[1]
        finally:
            server.shutdown()
            thread.join()


def told(http_port: int) -> str:
    """What the stream says of a sensor with this port."""
    stream = NetFtStream("127.0.0.1", port=RDT_PORT, http_port=http_port)
    try:
        assert until(lambda: stream.poll() == [] and stream.health.error != "")
        return stream.health.error
    finally:
        stream.close()


def test_a_port_on_which_nobody_listens() -> None:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    assert told(port).startswith(
        f"force/torque sensor at 127.0.0.1: its configuration page on port {port} cannot be read: "
    )


@pytest.mark.parametrize(("status", "text"), [(404, b""), (200, b"<html>a printer</html>")])
def test_the_page_of_another_device(status: int, text: bytes) -> None:
    with page(status, text) as port:
        assert told(port).startswith(
            f"force/torque sensor at 127.0.0.1: its configuration page on port {port} is not that of a Net "
            "F/T sensor: "
        )
