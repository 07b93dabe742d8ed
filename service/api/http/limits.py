"""Limits for one client: size and duration of a body, requests per second."""

import asyncio
import time
from collections import OrderedDict
from dataclasses import dataclass

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from contactsense.service.api.http.access import refuse

_CLIENTS = 1000
"""Number of clients whose request rates are stored."""


@dataclass(frozen=True, slots=True)
class RequestLimits:
    """Limits of each request."""

    body: int = 8_000_000
    """Largest body [bytes]."""
    body_time: float = 10.0
    """Longest time for a body to arrive [s]."""
    rate: float = 500.0
    """Requests per second from one address; bursts may have twice as many."""


class Limits:
    """ASGI middleware: answers 413, 408 and 429 before it reads further."""

    def __init__(self, app: ASGIApp, limits: RequestLimits, refused: dict[int, int]) -> None:
        """`refused` is filled with the number of refused requests by status."""
        self._app = app
        self._limits = limits
        self._buckets: OrderedDict[str, tuple[float, float]] = OrderedDict()
        self._refused = refused
        refused.update({408: 0, 413: 0, 429: 0})

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on requests within the limits."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        client = scope.get("client")
        if not self._admit(client[0] if client else ""):
            reason = f"more than {self._limits.rate:g} requests a second from one address"
            await self._refuse(scope, receive, send, 429, reason)
            return
        if scope["type"] == "websocket":
            await self._app(scope, receive, send)
            return
        length = dict(scope["headers"]).get(b"content-length", b"0")
        if not length.isdigit() or int(length) > self._limits.body:
            await self._refuse(scope, receive, send, 413, self._too_large(length.decode("latin-1")))
            return
        await self._bounded(scope, receive, send)

    async def _bounded(self, scope: Scope, receive: Receive, send: Send) -> None:
        deadline = asyncio.get_running_loop().time() + self._limits.body_time
        size, complete, begun = 0, False, False
        refusal: tuple[int, str] | None = None

        async def bounded_receive() -> Message:
            nonlocal size, complete, refusal
            if complete:
                return await receive()
            try:
                async with asyncio.timeout_at(deadline):
                    message = await receive()
            except TimeoutError:
                refusal = 408, f"the body did not arrive within {self._limits.body_time:g} s"
                raise
            size += len(message.get("body", b""))
            complete = not message.get("more_body", False)
            if size > self._limits.body:
                refusal = 413, self._too_large("more")
                raise _TooLargeError
            return message

        async def bounded_send(message: Message) -> None:
            # Discard the application's response to an incomplete body.
            nonlocal begun
            if refusal is None or begun:
                begun = True
                await send(message)

        try:
            await self._app(scope, bounded_receive, bounded_send)
        except (_TooLargeError, TimeoutError):
            if refusal is None:
                raise
        if refusal is not None and not begun:
            await self._refuse(scope, receive, send, *refusal)

    async def _refuse(self, scope: Scope, receive: Receive, send: Send, status: int, reason: str) -> None:
        self._refused[status] += 1
        await refuse(scope, receive, send, status, "", reason, retry=1 if status == 429 else None)

    def _too_large(self, got: str) -> str:
        return f"the body is too large: expected at most {self._limits.body} bytes, got {got:.20}"

    def _admit(self, client: str) -> bool:
        """Whether that client is within its rate: a token bucket for each address."""
        now = time.monotonic()
        most = 2.0 * self._limits.rate
        level, last = self._buckets.pop(client, (most, now))
        level = min(most, level + (now - last) * self._limits.rate)
        admitted = level >= 1.0
        self._buckets[client] = (level - 1.0 if admitted else level, now)
        if len(self._buckets) > _CLIENTS:
            self._buckets.popitem(last=False)
        return admitted


class _TooLargeError(Exception):
    """The body exceeds its limit."""
