"""Query parameters that are unknown, or given twice, are refused: they would do nothing unnoticed."""

from collections import Counter
from collections.abc import Iterator
from typing import get_args, get_origin

from fastapi import WebSocket
from fastapi.exceptions import RequestValidationError, WebSocketRequestValidationError
from starlette.requests import HTTPConnection

from contactsense.robots.files.near_names import did_you_mean

TOKEN = "token"
"""Parameter by which a WebSocket may send its token; see `contactsense.service.api.http.access`."""


def refuse_unknown_parameters(connection: HTTPConnection) -> None:
    """Refuse a request with parameters that its route does not have, or with several values of one that
    takes one.

    Raises:
        RequestValidationError: There are some; the error names them, and the parameters that the route has.
        WebSocketRequestValidationError: The same for a WebSocket.
    """
    stream = isinstance(connection, WebSocket)
    errors = [
        {"type": "value_error", "loc": ("query", name[:40]), "msg": reason, "input": None}
        for name, reason in _refused(connection, (TOKEN,) if stream else ())
    ]
    if errors:
        raise WebSocketRequestValidationError(errors) if stream else RequestValidationError(errors)


def _refused(connection: HTTPConnection, also: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """Parameters that are refused, and why; `also`: others than those of the route that are accepted."""
    fields = connection.scope["route"].dependant.query_params
    names = [field.alias for field in fields]
    lists = [field.alias for field in fields if _is_list(field.field_info.annotation)]
    known = f"known: {', '.join(names)}" if names else "there are none here"
    for name, count in Counter(name for name, _ in connection.query_params.multi_items()).items():
        if name not in names and name not in also:
            yield name, f"unknown parameter{did_you_mean(name, names)}; {known}"
        elif count > 1 and name not in lists:
            yield name, f"expected one value, got {count}"


def _is_list(annotation: object) -> bool:
    """Whether a parameter of that type, which may be optional, takes several values."""
    return any(get_origin(part) is list for part in (annotation, *get_args(annotation)))
