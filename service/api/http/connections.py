"""uvicorn's protocols with limits: number of connections, duration and size of a request's head, and time for
which a client may read nothing.

If there are too many connections, the one gives way that has been without a request for longest: half-sent
heads and idle connections lock nobody out.
"""

import asyncio
from dataclasses import dataclass, field
from typing import Any

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol
from uvicorn.protocols.utils import ClientDisconnected
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol


@dataclass(slots=True)
class ConnectionLimits:
    """Limits of connections, and counters of their effects."""

    connections: int = 200
    """Largest number of open connections, WebSockets included."""
    head_time: float = 5.0
    """Longest time for a request's head to arrive [s]."""
    head_size: int = 32_768
    """Largest head of a request [bytes]."""
    reader_time: float = 10.0
    """A client that reads nothing for this time is disconnected [s]."""
    refused: int = 0
    """Connections refused because there were too many."""
    late: int = 0
    """Connections closed because the head was too slow or too large, or gave way to another connection."""
    dropped: int = 0
    """Connections closed because the client read nothing."""
    opened: int = 0
    """Number of open connections."""
    waiting: "dict[LimitedHttp, None]" = field(default_factory=dict)
    """Connections without a complete head, the longest without one first."""


class _Guard:
    """Common part of both protocols: the timer for a client that reads nothing."""

    limits: ConnectionLimits
    loop: asyncio.AbstractEventLoop
    transport: asyncio.Transport
    _stalled: asyncio.TimerHandle | None = None

    def _stall(self) -> None:
        self._stalled = self.loop.call_later(self.limits.reader_time, self._drop)

    def _resume(self) -> None:
        if self._stalled is not None:
            self._stalled.cancel()
            self._stalled = None

    def _drop(self) -> None:
        self.limits.dropped += 1
        self.transport.abort()


class _HeadTooLargeError(Exception):
    """Ends the parser's work on a request that is refused."""


class LimitedHttp(_Guard, HttpToolsProtocol):
    """HTTP/1.1 with limits; see `http_protocol`."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._head: asyncio.TimerHandle | None = None
        self._head_size = 0
        self._in_body = False
        self._answered = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """If there are too many connections, one without a request gives way, or this one is refused."""
        super().connection_made(transport)
        self.limits.opened = len(self.connections)
        if self.limits.opened > self.limits.connections:
            if not self.limits.waiting:
                self.limits.refused += 1
                self._answer(b"503 Service Unavailable", b"too many connections")
                return
            next(iter(self.limits.waiting))._give_way()
        self.limits.waiting[self] = None
        self._expect_head()

    def connection_lost(self, exc: Exception | None) -> None:
        """Cancel the timers."""
        self._head_has_come()
        self.limits.waiting.pop(self, None)
        self._resume()
        super().connection_lost(exc)
        self.limits.opened = len(self.connections)

    def data_received(self, data: bytes) -> None:
        """Count the bytes of the head."""
        if self._answered or self.transport.is_closing():
            return
        if not self._in_body:
            if self._head is None:
                self._expect_head()
            self._head_size += len(data)
        super().data_received(data)
        if self._head is not None and self._head_size > self.limits.head_size:
            self._too_large()

    def on_headers_complete(self) -> None:
        """The head is complete: stop its timer.

        Raises:
            _HeadTooLargeError: It is too large, though it came whole in one piece.
        """
        # A field has a colon and a line break beside name and value.
        if (
            len(self.url) + sum(len(name) + len(value) + 3 for name, value in self.headers)
            > self.limits.head_size
        ):
            self._too_large()
            raise _HeadTooLargeError
        self._head_has_come()
        self.limits.waiting.pop(self, None)
        self._in_body = True
        super().on_headers_complete()

    def on_message_complete(self) -> None:
        """The body is complete: the next bytes are the head of another request."""
        self._in_body = False
        super().on_message_complete()

    def on_response_complete(self) -> None:
        """The response is sent: unless there is another request, the connection is idle."""
        idle = not (self.pipeline or self._in_body or self.transport.is_closing())
        super().on_response_complete()
        if idle:
            self.limits.waiting[self] = None

    def send_400_response(self, msg: str) -> None:
        """What arrived is no HTTP: an answer in the form of all others, if there has been none yet."""
        if not self._answered:
            self._answer(b"400 Bad Request", b"expected a request of HTTP/1.1, got other bytes")

    def pause_writing(self) -> None:
        """The client reads nothing."""
        self._stall()
        self.flow.pause_writing()

    def resume_writing(self) -> None:
        """The client reads again."""
        self._resume()
        self.flow.resume_writing()

    def _expect_head(self) -> None:
        self._head_size = 0
        self._head = self.loop.call_later(self.limits.head_time, self._late)

    def _head_has_come(self) -> None:
        if self._head is not None:
            self._head.cancel()
            self._head = None

    def _give_way(self) -> None:
        self.limits.late += 1
        self.limits.waiting.pop(self)
        # At once: closing after an answer would keep the connection for a while.
        self.transport.abort()

    def _too_large(self) -> None:
        self.limits.late += 1
        self._answer(
            b"431 Request Header Fields Too Large",
            f"the head of the request is larger than {self.limits.head_size} bytes".encode(),
        )

    def _late(self) -> None:
        self.limits.late += 1
        self._answer(b"408 Request Timeout", b"the head of the request took too long")

    def _answer(self, status: bytes, reason: bytes) -> None:
        self._head_has_come()
        if not self.transport.is_closing():
            body = b'{"errors":[{"field":"","reason":"' + reason + b'"}]}'
            self.transport.write(
                b"HTTP/1.1 "
                + status
                + b"\r\ncontent-type: application/json\r\nconnection: close\r\ncontent-length: "
                + str(len(body)).encode()
                + b"\r\n\r\n"
                + body
            )
            self._answered = True
            # Closing with unread bytes would reset the connection; the client would lose the answer.
            if self.transport.can_write_eof():
                self.transport.write_eof()
            else:
                self.transport.close()
            self.loop.call_later(1.0, self.transport.abort)


class LimitedWebSocket(_Guard, WebSocketsSansIOProtocol):
    """WebSockets with limits; see `websocket_protocol`."""

    def connection_lost(self, exc: Exception | None) -> None:
        """Cancel the timer."""
        self._resume()
        super().connection_lost(exc)
        self.limits.opened = len(self.connections)

    def send_receive_event_to_app(self) -> None:
        """Pass on a message. One of text that is not UTF-8 ends the connection, as RFC 6455 asks; uvicorn
        would log a traceback."""
        if self.curr_msg_data_type == "text":
            try:
                b"".join(self.frames).decode()
            except UnicodeDecodeError:
                self.frames = []
                self.conn.fail(1007, "expected text in UTF-8, got other bytes")
                self.handle_parser_exception()
                return
        super().send_receive_event_to_app()

    async def send(self, message: Any) -> None:
        """Send a message. A refusal, once complete, is all that there will be: uvicorn would log each as an
        error of the application.

        Raises:
            ClientDisconnected: The connection is lost. asyncio tells that only when it has its turn, and
                would log each message that is written before: those that wait for a reader are many.
        """
        await self.writable.wait()
        if message["type"] == "websocket.send" and self.transport.is_closing():
            raise ClientDisconnected
        await super().send(message)
        if message["type"] == "websocket.http.response.body" and not message.get("more_body"):
            self.handshake_complete = True

    def shutdown(self) -> None:
        """The service ends. A client that reads nothing takes no farewell, either, and would hold up the
        end."""
        if self._stalled is None:
            super().shutdown()
        else:
            self.transport.abort()

    def pause_writing(self) -> None:
        """The client reads nothing."""
        self._stall()
        super().pause_writing()

    def resume_writing(self) -> None:
        """The client reads again."""
        self._resume()
        super().resume_writing()


def http_protocol(limits: ConnectionLimits) -> type[asyncio.Protocol]:
    """The protocol class for HTTP/1.1 with these limits: uvicorn creates the objects itself."""
    return type("Http", (LimitedHttp,), {"limits": limits})


def websocket_protocol(limits: ConnectionLimits) -> type[asyncio.Protocol]:
    """The same for WebSockets."""
    return type("WebSocket", (LimitedWebSocket,), {"limits": limits})
