"""One RTDE connection and a peer that is scripted byte by byte."""

import contextlib
import socket
import struct
import threading
import time
from collections.abc import Iterator
from types import SimpleNamespace

import pytest

from contactsense.service.sensors.clients import rtde_client
from contactsense.service.sensors.clients.robot_stream import NS, SensorError
from contactsense.service.sensors.clients.rtde_client import RtdeConnection
from contactsense.service.wire import rtde as wire

NAMES = ("timestamp", "actual_q")
RECIPE = wire.Recipe(1, NAMES, ("DOUBLE", "VECTOR6D"))
SET_UP = b"".join(
    wire.encode(reply)
    for reply in (
        wire.ProtocolVersionReply(True),
        wire.SetupReply(False, 1, RECIPE.types),
        wire.StartReply(True),
    )
)
WORDS = wire.encode(wire.TextMessage("no answer", "peer", 3))


def packet(t: float) -> bytes:
    return RECIPE.pack([t, *6 * [0.0]])


@contextlib.contextmanager
def connected(names: tuple[str, ...] = NAMES) -> Iterator[tuple[RtdeConnection, socket.socket]]:
    """A connection that is set up, and the peer's side of it."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        accepted: list[socket.socket] = []

        def serve() -> None:
            accepted.append(server.accept()[0])
            accepted[0].sendall(SET_UP)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        connection = RtdeConnection(
            "127.0.0.1", names, port=server.getsockname()[1], timeout=10.0, silence=0.5
        )
        thread.join()
        with accepted[0], contextlib.closing(connection):
            yield connection, accepted[0]


def reset(peer: socket.socket) -> None:
    """Close without a farewell, as after a power failure of the peer."""
    peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    peer.close()


def test_a_connection_that_is_reset_is_told() -> None:
    with connected() as (connection, peer):
        reset(peer)
        with pytest.raises(SensorError, match=r"robot at .*: connection lost: Connection reset by peer"):
            connection.read(10.0)


def test_a_connection_that_is_reset_during_the_setup_is_told() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            peer, _ = server.accept()
            peer.recv(4096)
            reset(peer)

        threading.Thread(target=serve, daemon=True).start()
        with pytest.raises(
            SensorError, match="connection lost upon ProtocolVersionRequest: Connection reset"
        ):
            RtdeConnection("127.0.0.1", NAMES, port=server.getsockname()[1], timeout=10.0)


def test_a_peer_that_talks_without_answering_is_given_up() -> None:
    """Each of its messages comes within the time limit."""
    done = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            peer, _ = server.accept()
            with peer, contextlib.suppress(OSError):
                while not done.wait(0.02):
                    peer.sendall(WORDS)

        threading.Thread(target=serve, daemon=True).start()
        try:
            with pytest.raises(SensorError, match=r"no answer to ProtocolVersionRequest within 0\.2 s"):
                RtdeConnection("127.0.0.1", NAMES, port=server.getsockname()[1], timeout=0.2)
        finally:
            done.set()


@pytest.mark.parametrize("names", [("actual_q",), NAMES])
def test_the_time_stamp_is_asked_for_once(names: tuple[str, ...]) -> None:
    with connected(names) as (connection, peer):
        peer.sendall(packet(1.5))
        (record,) = connection.read(10.0)
        assert record.timestamp == 1.5
        assert connection.recipe.names == NAMES


def looks(connection: RtdeConnection, clock: SimpleNamespace, count: int) -> None:
    """Look for packets every 50 ms of a clock that does not wait."""
    for _ in range(count):
        clock.now += NS // 20
        assert connection.read(0.0) == []


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """The clock of the connection, which is set by the test."""
    made = SimpleNamespace(now=0, monotonic=time.monotonic)
    made.monotonic_ns = lambda: made.now
    monkeypatch.setattr(rtde_client, "time", made)
    return made


def test_a_packet_ends_a_silence(clock: SimpleNamespace) -> None:
    with connected() as (connection, peer):
        looks(connection, clock, 8)
        peer.sendall(packet(2.0))
        assert len(connection.read(10.0)) == 1
        looks(connection, clock, 8)
        with pytest.raises(SensorError, match=r"has been silent for 0\.5 s"):
            looks(connection, clock, 8)


def test_a_text_message_ends_no_silence(clock: SimpleNamespace) -> None:
    """Without samples nothing is estimated."""
    with connected() as (connection, peer):
        looks(connection, clock, 8)
        peer.sendall(WORDS)
        assert connection.read(10.0) == []
        with pytest.raises(SensorError, match=r"has been silent for 0\.5 s"):
            looks(connection, clock, 8)
