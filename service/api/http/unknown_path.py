"""Answers to requests for a path that has no route of their kind."""

from collections.abc import Sequence

from starlette.exceptions import HTTPException
from starlette.routing import BaseRoute, Match
from starlette.types import Receive, Scope, Send

from contactsense.service.api.http.access import refuse


class UnknownPath:
    """ASGI application for what no route takes: tells HTTP and WebSocket requests from each other.

    Without it the path of a WebSocket would not exist for HTTP, and a WebSocket to a wrong path would be
    answered with 403, as if a token were missing.
    """

    def __init__(self, routes: Sequence[BaseRoute]) -> None:
        self._routes = routes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse the request.

        Raises:
            HTTPException: It is an HTTP request: 426 for the path of a WebSocket, otherwise 404.
        """
        path = f"{scope['path']:.80}"
        if scope["type"] == "websocket":
            reason = f"there is no WebSocket {path}; GET /docs describes the interface"
            if self._takes({**scope, "type": "http", "method": "GET"}):
                reason = f"{path}: expected an HTTP request, got a WebSocket"
            await refuse(scope, receive, send, 404, "", reason)
        elif self._takes({**scope, "type": "websocket"}):
            raise HTTPException(
                426, f"{path}: expected a WebSocket, got an HTTP request", {"Upgrade": "websocket"}
            )
        else:
            raise HTTPException(404)

    def _takes(self, scope: Scope) -> bool:
        return any(route.matches(scope)[0] is not Match.NONE for route in self._routes)
