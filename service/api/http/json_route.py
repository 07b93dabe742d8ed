"""Routes whose JSON bodies may not have a name twice, nor thousands of them."""

from collections.abc import Callable, Coroutine
from typing import Any

from fastapi import Request, Response
from fastapi.routing import APIRoute
from starlette.exceptions import HTTPException

from contactsense.service.json_objects import ObjectError, parse_json


class BodyObjectError(HTTPException):
    """An object in a body has a field twice, or too many of them."""

    def __init__(self, field: str, reason: str) -> None:
        super().__init__(422, reason)
        self.field = field


class JsonRoute(APIRoute):
    """A route that refuses a body in which a field is given twice, instead of using its last value."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """The handler of requests."""
        handle = super().get_route_handler()

        async def handle_unique(request: Request) -> Response:
            return await handle(_Request(request.scope, request.receive))

        return handle_unique


class _Request(Request):
    async def json(self) -> Any:
        try:
            return parse_json(await self.body())
        except ObjectError as error:
            raise BodyObjectError(error.name, error.reason) from None
