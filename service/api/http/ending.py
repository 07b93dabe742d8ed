"""Requests that are open when the service ends."""

import asyncio
import json

from starlette.types import ASGIApp, Message, Receive, Scope, Send

REASON = "the service is ending"


class Ending:
    """ASGI middleware: answers 503 where the server gives a request up, some seconds after a signal.

    The server cancels the request's task. Otherwise that is answered with 500, and logged with a traceback.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on all requests."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        begun = False

        async def watched_send(message: Message) -> None:
            nonlocal begun
            begun = True
            await send(message)

        try:
            await self._app(scope, receive, watched_send)
        except asyncio.CancelledError:
            if begun:  # the client sees that the answer is not complete
                return
            body = json.dumps({"errors": [{"field": "", "reason": REASON}]}).encode()
            headers = [
                (b"content-type", b"application/json"),
                (b"content-length", str(len(body)).encode()),
                (b"connection", b"close"),
            ]
            await send({"type": "http.response.start", "status": 503, "headers": headers})
            await send({"type": "http.response.body", "body": body})
