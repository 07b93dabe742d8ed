"""Unknown query parameters are refused: a misspelled one would otherwise do nothing unnoticed."""

from typing import Any

from fastapi import WebSocket
from fastapi.exceptions import RequestValidationError, WebSocketRequestValidationError
from starlette.requests import HTTPConnection

from contactsense.robots.near_names import did_you_mean

TOKEN = "token"
"""Parameter by which a WebSocket may send its token; see `contactsense.service.api.access`."""


def refuse_unknown_parameters(connection: HTTPConnection) -> None:
    """Refuse a request with parameters that its route does not have.

    Raises:
        RequestValidationError: There are some; the error names them, and those that the route has.
        WebSocketRequestValidationError: The same for a WebSocket.
    """
    names = [field.alias for field in connection.scope["route"].dependant.query_params]
    stream = isinstance(connection, WebSocket)
    accepted = {*names, TOKEN} if stream else set(names)
    unknown = [name for name in dict.fromkeys(connection.query_params) if name not in accepted]
    if not unknown:
        return
    known = f"known: {', '.join(names)}" if names else "there are none here"
    errors: list[dict[str, Any]] = [
        {
            "type": "value_error",
            "loc": ("query", name[:40]),
            "msg": f"unknown parameter{did_you_mean(name, names)}; {known}",
            "input": None,
        }
        for name in unknown
    ]
    raise WebSocketRequestValidationError(errors) if stream else RequestValidationError(errors)
