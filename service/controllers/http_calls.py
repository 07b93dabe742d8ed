"""The subset of HTTP that XML-RPC clients use: bytes in, requests out. httptools does the parsing."""

from dataclasses import dataclass

import httptools

from contactsense.service.controllers.xmlrpc import MAX_BODY

_MAX_HEAD = 8192
"""Largest head of a request [bytes]."""


class HttpError(ValueError):
    """The bytes are not a supported HTTP request; the rest of the connection cannot be read."""

    def __init__(self, status: str, reason: str) -> None:
        super().__init__(f"{status}: {reason}")
        self.status, self.reason = status, reason


@dataclass(slots=True)
class HttpRequest:
    """One request."""

    method: bytes
    target: bytes
    body: bytes
    keep_alive: bool
    """Whether the client keeps the connection open."""


class HttpReader:
    """Parses requests from a stream of bytes."""

    def __init__(self) -> None:
        self._requests: list[HttpRequest] = []
        self._parser = httptools.HttpRequestParser(self)
        self._head = 0
        self._in_head = True
        self._expects = False
        self.on_message_begin()

    def feed(self, chunk: bytes) -> list[HttpRequest]:
        """Add bytes; returns the requests that are now complete.

        Raises:
            HttpError: The bytes are not HTTP, or the request is too large.
        """
        # The size of a head is counted per piece, so that a long chunk does not count as one head.
        for begin in range(0, len(chunk), _MAX_HEAD):
            piece = chunk[begin : begin + _MAX_HEAD]
            self._head = self._head + len(piece) if self._in_head else 0
            try:
                self._parser.feed_data(piece)
            except httptools.HttpParserUpgrade:
                raise HttpError("400 Bad Request", "expected no upgrade") from None
            except httptools.HttpParserError as error:
                cause = error.__context__
                if isinstance(cause, HttpError):
                    raise cause from None
                raise HttpError("400 Bad Request", str(error)) from None
            if self._in_head and self._head > 2 * _MAX_HEAD:
                raise HttpError("431 Request Header Fields Too Large", f"expected at most {_MAX_HEAD} bytes")
        requests, self._requests = self._requests, []
        return requests

    @property
    def begun(self) -> bool:
        """Whether an incomplete request has begun."""
        return not self._in_head or self._head > 0

    def take_continue(self) -> bool:
        """Whether the client waits for `100 Continue` before it sends the body; resets this state."""
        expects, self._expects = self._expects and not self._in_head, False
        return expects

    def on_message_begin(self) -> None:
        """Called by httptools."""
        self._target = self._body = b""

    def on_url(self, url: bytes) -> None:
        """Called by httptools."""
        self._target += url

    def on_header(self, name: bytes, value: bytes) -> None:
        """Called by httptools."""
        if name.lower() == b"expect" and value.lower() == b"100-continue":
            self._expects = True

    def on_headers_complete(self) -> None:
        """Called by httptools."""
        self._in_head = False

    def on_body(self, body: bytes) -> None:
        """Called by httptools."""
        if len(self._body) + len(body) > MAX_BODY:
            raise HttpError("413 Content Too Large", f"expected at most {MAX_BODY} bytes")
        self._body += body

    def on_message_complete(self) -> None:
        """Called by httptools."""
        method, keep_alive = self._parser.get_method(), self._parser.should_keep_alive()
        self._requests.append(HttpRequest(method, self._target, self._body, keep_alive))
        self._in_head, self._head, self._expects = True, 0, False


def http_response(body: bytes, content_type: str, keep_alive: bool, status: str = "200 OK") -> bytes:
    """Encode a response."""
    return (
        f"HTTP/1.1 {status}\r\nContent-Type: {content_type}\r\nContent-Length: {len(body)}\r\n"
        f"Connection: {'keep-alive' if keep_alive else 'close'}\r\n\r\n"
    ).encode() + body
