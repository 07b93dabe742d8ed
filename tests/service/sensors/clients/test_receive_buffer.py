"""The socket of a force/torque sensor holds the readings of seconds in which its reader has no processor."""

import os
import socket
from collections.abc import Iterator

import numpy as np
import pytest

from contactsense.service.mock.interfaces.netft_server import NetFtServer
from contactsense.service.mock.playback import SimClock
from contactsense.service.sensors.clients import netft_client, receive_buffer
from contactsense.service.sensors.clients.netft_client import NetFtStream
from tests.service.loopback import own_address, until

pytestmark = pytest.mark.skipif(not os.path.isdir("/dev/fd"), reason="sockets cannot be found here")


def granted() -> int:
    """What this computer grants who asks for the size."""
    with udp_socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer.SIZE)
        return size_of(probe)


def udp_socket() -> socket.socket:
    return socket.socket(socket.AF_INET, socket.SOCK_DGRAM)


def size_of(found: socket.socket) -> int:
    return found.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)


@pytest.fixture
def sensor() -> Iterator[NetFtServer]:
    with NetFtServer(lambda t: np.full(6, t), SimClock(), host=own_address(), port=0) as server:
        yield server


def stream_of(server: NetFtServer) -> NetFtStream:
    return NetFtStream(server.host, port=server.port, counts=(1e6, 1e6))


def test_only_sockets_of_that_peer_are_enlarged() -> None:
    with udp_socket() as ours, udp_socket() as other, udp_socket() as unconnected, udp_socket() as peer:
        peer.bind(("127.0.0.1", 0))
        ours.connect(peer.getsockname())
        other.connect(("127.0.0.1", 9))
        before = size_of(other)
        opened = len(os.listdir("/dev/fd"))
        assert receive_buffer.enlarge(peer.getsockname()) == granted() == size_of(ours)
        assert size_of(other) == size_of(unconnected) == before
        # No buffer shrinks, and no copy stays open.
        assert receive_buffer.enlarge(peer.getsockname(), 4096) == granted()
        assert len(os.listdir("/dev/fd")) == opened


def test_a_peer_without_a_socket_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    assert receive_buffer.enlarge(("127.0.0.1", 9)) == 0
    monkeypatch.setattr(receive_buffer, "_DESCRIPTORS", "/there/is/no/such/folder")
    assert receive_buffer.enlarge(("127.0.0.1", 9)) == 0


def test_every_connection_to_a_sensor_is_enlarged(sensor: NetFtServer) -> None:
    stream = stream_of(sensor)

    def size() -> int:
        stream.poll()
        return receive_buffer.enlarge((sensor.host, sensor.port), 0)

    assert until(lambda: size() == granted())
    sensor.mute = True
    assert until(lambda: stream.poll() == [] and stream.health.reconnects > 0)
    sensor.mute = False
    assert until(stream.poll)
    assert until(lambda: size() == granted())
    stream.close()


def test_readings_that_are_not_fetched_in_time_count_as_lost(
    sensor: NetFtServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(netft_client, "_QUEUE", 8)
    stream = stream_of(sensor)
    assert until(lambda: stream.health.overrun > 0)
    health = stream.health
    assert health.lost >= health.overrun > 0
    stream.close()
