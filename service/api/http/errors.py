"""Error responses of the service: always an `ErrorOut` with field and reason."""

from collections.abc import Mapping
from typing import Any

from fastapi import FastAPI, Request, Response, WebSocket
from fastapi.exceptions import RequestValidationError, WebSocketRequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection

from contactsense.robots.files.field_errors import joined, reasons
from contactsense.service.api.http.json_route import BodyObjectError
from contactsense.service.api.messages import ErrorOut, FieldError

Responses = dict[int | str, dict[str, Any]]


def _documented(refusals: Mapping[int, str]) -> Responses:
    return {status: {"model": ErrorOut, "description": text} for status, text in refusals.items()}


COMMON_REFUSALS = _documented(
    {
        400: "The Host is not one of the service's, or the request is not HTTP.",
        401: "A token is missing or wrong.",
        403: "The request comes from a foreign web page.",
        413: "The body is too large.",
        422: "A parameter or the body cannot be used: field and reason.",
        429: "Too many requests a second from one address.",
        503: "There are too many connections.",
    }
)
"""Error responses of any route."""
BODY_REFUSALS = _documented(
    {
        400: "The body is not text in UTF-8, or the Host is not one of the service's.",
        408: "The body did not arrive in time.",
    }
)
"""Additional error responses of a route with a body."""


class FieldRefusedError(Exception):
    """A value is well-formed but does not fit the scene."""

    def __init__(self, field: str, reason: str) -> None:
        super().__init__(f"{field}: {reason}")
        self.field, self.reason = field, reason


def install(app: FastAPI) -> None:
    """Install the handlers that give all errors of `app` this form."""
    app.add_exception_handler(RequestValidationError, _refuse)
    app.add_exception_handler(WebSocketRequestValidationError, _refuse_stream)
    app.add_exception_handler(FieldRefusedError, _refuse_field)
    app.add_exception_handler(HTTPException, _http_error)
    app.add_exception_handler(Exception, _fault)


def _errors(status: int, errors: list[FieldError], headers: Mapping[str, str] | None = None) -> JSONResponse:
    return JSONResponse(ErrorOut(errors=errors).model_dump(), status, headers)


def _field_errors(
    connection: HTTPConnection, error: RequestValidationError | WebSocketRequestValidationError
) -> list[FieldError]:
    """Convert the errors of a body or of parameters to field and reason."""
    issues = error.errors()
    for issue in issues:
        text = _reason_of_body(connection, issue)
        if text is not None:
            return [FieldError(field="", reason=text)]
    # A location begins with where it is: in the body, the query or the path.
    placed = [{**issue, "loc": issue["loc"][1:]} for issue in issues]
    bodies = connection.scope["route"].dependant.body_params
    annotation = bodies[0].field_info.annotation if bodies else None
    return [
        FieldError(field=joined(place), reason=text) for place, text in reasons(placed, annotation).items()
    ]


def _reason_of_body(connection: HTTPConnection, issue: Mapping[str, Any]) -> str | None:
    """What is wrong with the body as a whole; None: nothing."""
    if issue["type"] == "json_invalid":
        return f"not JSON: {issue['ctx']['error']} at character {issue['loc'][-1]}"
    if issue["type"] == "missing" and issue["loc"] == ("body",):
        return "expected a body in JSON, got none"
    if isinstance(issue["input"], bytes):
        # It has not been parsed, as its type does not say that it is JSON.
        given = connection.headers.get("content-type", "none")
        return f"expected the header Content-Type: application/json, got {given:.60}"
    return None


async def _refuse(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    return _errors(422, _field_errors(request, error))


async def _refuse_field(request: Request, error: Exception) -> Response:
    assert isinstance(error, FieldRefusedError)
    return _errors(422, [FieldError(field=error.field, reason=error.reason)])


async def _refuse_stream(websocket: WebSocket, error: Exception) -> None:
    assert isinstance(error, WebSocketRequestValidationError)
    errors = _field_errors(websocket, error)
    await websocket.accept()
    await websocket.send_text(ErrorOut(errors=errors).model_dump_json())
    text = "; ".join(f"{issue.field}: {issue.reason}" for issue in errors)
    room = text.encode()[:123]  # of a close frame
    await websocket.close(1008, room.decode(errors="ignore"))


async def _http_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    # With 405 the headers contain the allowed methods.
    text = str(error.detail)
    if error.status_code == 404 and text == "Not Found":
        text = f"there is no {request.url.path:.80}; GET /docs describes the interface"
    elif error.status_code == 405:
        allowed = (error.headers or {}).get("Allow", "another method")
        text = f"{request.url.path:.80}: expected {allowed}, got {request.method:.20}"
    elif error.status_code == 400 and text == "There was an error parsing the body":
        text = "expected a body in JSON: text in UTF-8, not nested deeply"
    field = error.field if isinstance(error, BodyObjectError) else ""
    return _errors(error.status_code, [FieldError(field=field, reason=text)], error.headers)


async def _fault(_: Request, error: Exception) -> Response:
    """An error that nobody expected: the server logs it."""
    reason = (
        f"{type(error).__name__} in the service, a fault of the program; the log of the service says more"
    )
    return _errors(500, [FieldError(field="", reason=reason)])
