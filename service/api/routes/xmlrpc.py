"""XML-RPC on the service's own port, for clients that can send its token."""

from fastapi import APIRouter, Request, Response
from starlette.exceptions import HTTPException

from contactsense.service.api.http.errors import BODY_REFUSALS
from contactsense.service.controllers.robot_program_servers import XML, answer_call
from contactsense.service.controllers.xmlrpc import MAX_BODY

router = APIRouter()


@router.post(
    "/RPC2",
    summary="XML-RPC",
    response_class=Response,
    responses={
        200: {"content": {XML: {}}, "description": "An array of doubles, the status first."},
        408: BODY_REFUSALS[408],
    },
)
async def rpc2(request: Request) -> Response:
    """Methods for robot programs; see docs/controllers.md."""
    body = b""
    async for chunk in request.stream():
        body += chunk
        if len(body) > MAX_BODY:
            raise HTTPException(413, f"expected at most {MAX_BODY} bytes")
    return Response(answer_call(request.app.state.service.robot_program, body), media_type=XML)
