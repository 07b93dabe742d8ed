"""Routes for the pipeline's estimates: the latest one, and the stream of all."""

import asyncio
import contextlib
from typing import Annotated

from fastapi import APIRouter, Query, Response, WebSocket, WebSocketDisconnect
from starlette.exceptions import HTTPException

from contactsense.service.api.messages import ErrorOut, EstimateOut
from contactsense.service.api.service import Shared
from contactsense.service.live.hub import Reader

router = APIRouter()


@router.get(
    "/v1/contacts",
    summary="The latest estimate",
    response_model=EstimateOut,
    responses={503: {"model": ErrorOut, "description": "There is no current estimate: the reason says why."}},
)
async def contacts(service: Shared) -> Response:
    """The latest estimate. 503 while none is current; the response gives the reason."""
    if not service.runner.current or service.hub.last is None:
        raise HTTPException(503, f"no current estimate: {service.runner.message}")
    return Response(service.hub.last, media_type="application/json")


@router.websocket("/v1/stream")
async def stream(
    websocket: WebSocket,
    service: Shared,
    every: Annotated[int, Query(ge=1, le=1_000_000)] = 1,
    rate: Annotated[float | None, Query(ge=0.001, le=1e6, allow_inf_nan=False)] = None,
) -> None:
    """One estimate per sample as JSON text, decimated as requested."""
    await websocket.accept()
    with service.hub.subscribe(every, 0.0 if rate is None else 1.0 / rate) as reader:
        sending = asyncio.create_task(_send(websocket, reader))
        leaving = asyncio.create_task(_until_gone(websocket))
        try:
            await asyncio.wait({sending, leaving}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            sending.cancel()
            leaving.cancel()
            await asyncio.gather(sending, leaving, return_exceptions=True)


async def _send(websocket: WebSocket, reader: Reader) -> None:
    while True:
        message = await reader.take()
        if lost := reader.take_lost():
            await websocket.send_text(f'{{"lost":{lost}}}')
        await websocket.send_text(message.decode())


async def _until_gone(websocket: WebSocket) -> None:
    """Receive and ignore messages of the reader until it disconnects."""
    with contextlib.suppress(WebSocketDisconnect):
        while True:
            message = await websocket.receive()
            if message["type"] == "websocket.disconnect":
                return
