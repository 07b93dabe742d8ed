"""A reader that has left, with messages that wait for it."""

import asyncio

import pytest
import uvicorn
from uvicorn.protocols.utils import ClientDisconnected
from uvicorn.server import ServerState
from websockets.protocol import State

from contactsense.service.api.http.connections import ConnectionLimits, LimitedWebSocket, websocket_protocol


class Transport:
    """A connection that is lost with the first write, which the protocol is told only when the event loop
    has its turn."""

    def __init__(self) -> None:
        self.written = 0
        self.aborted = False

    def write(self, data: bytes) -> None:
        del data
        self.written += 1

    def is_closing(self) -> bool:
        return self.written > 0

    def close(self) -> None:
        """Waits until what was written has been read."""

    def abort(self) -> None:
        self.aborted = True


def opened(transport: Transport) -> LimitedWebSocket:
    """The server's end of a WebSocket; within an event loop."""
    config = uvicorn.Config(lambda: None, log_level="error")  # type: ignore[arg-type, misc]
    protocol = websocket_protocol(ConnectionLimits())(  # type: ignore[call-arg]
        config=config, server_state=ServerState(), app_state={}
    )
    assert isinstance(protocol, LimitedWebSocket)
    protocol.transport, protocol.handshake_complete = transport, True  # type: ignore[assignment]
    protocol.conn.state = State.OPEN
    return protocol


def test_nothing_is_written_to_a_connection_that_is_lost() -> None:
    """Hundreds of estimates may wait for it, and asyncio would log each as `socket.send() raised
    exception`."""

    async def send() -> None:
        protocol = opened(transport)
        for _ in range(100):
            await protocol.send({"type": "websocket.send", "text": "estimate"})

    transport = Transport()
    with pytest.raises(ClientDisconnected):
        asyncio.run(send())
    assert transport.written == 1


def test_the_end_does_not_wait_for_a_reader_that_reads_nothing() -> None:
    """It took three seconds, and the log had an error at each orderly stop."""

    async def shutdown(stalled: bool) -> Transport:
        transport = Transport()
        protocol = opened(transport)
        if stalled:
            protocol.pause_writing()
        protocol.shutdown()
        return transport

    assert asyncio.run(shutdown(stalled=True)).aborted
    others = asyncio.run(shutdown(stalled=False))
    assert (others.written, others.aborted) == (1, False)  # they get a farewell
