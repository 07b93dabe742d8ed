"""Events over HTTP and WebSocket: a reader that states the last number it has seen misses none."""

import asyncio
import contextlib
import json
from collections.abc import Sequence
from typing import Annotated

from fastapi import APIRouter, Depends, Query, Response, WebSocket, WebSocketDisconnect
from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection

from contactsense.service.api.messages import ErrorOut, FieldError
from contactsense.service.events.journal import Journal, JournalError
from contactsense.service.events.model import ContactEvent, Kind

router = APIRouter()
_BATCH = 200
"""Events that are read from the journal at a time."""


class EventsOut(BaseModel):
    """Events of the journal, oldest first."""

    events: list[ContactEvent] = Field(description="The events.")
    last: int = Field(
        description="Number of the newest event in the journal, listed here or not. If it is less than the "
        "request's `since`, that number is of another journal, and events are listed from the first on."
    )


def _journal(connection: HTTPConnection) -> Journal:
    journal: Journal = connection.app.state.service.journal
    return journal


SharedJournal = Annotated[Journal, Depends(_journal)]


def _body(events: Sequence[str], last: int) -> str:
    return f'{{"events":[{",".join(events)}],"last":{last}}}'


@router.get(
    "/v1/events",
    summary="Events of contacts",
    response_model=EventsOut,
    responses={
        500: {"model": ErrorOut, "description": "The journal's file is damaged: the reason says more."}
    },
)
async def events(
    journal: SharedJournal,
    since: Annotated[int, Query(ge=0, le=2**62, description="Number of the last event that is known.")] = 0,
    limit: Annotated[int, Query(ge=1, le=10_000, description="How many events at most.")] = 500,
    kind: Annotated[list[Kind] | None, Query(description="Kinds of events; default: all.")] = None,
) -> Response:
    """Events after number `since`, oldest first, at most `limit`; of the given kinds, by default of all.

    A `since` beyond the last number is of another journal: all events are listed.
    """
    last = journal.last
    try:
        found = await asyncio.to_thread(journal.since, since, limit, kind or ())
    except JournalError as error:
        raise HTTPException(500, str(error)) from None
    return Response(_body(found, last), media_type="application/json")


@router.websocket("/v1/events")
async def event_stream(
    websocket: WebSocket,
    journal: SharedJournal,
    since: Annotated[int | None, Query(ge=0, le=2**62)] = None,
) -> None:
    """Each event as JSON text: those after number `since` first, then live; without `since` live only.
    A `since` beyond the last number is of another journal: all its events come first.

    Events for a slow reader wait in the journal, not in memory. Where they cannot be read, as its file is
    damaged, an `ErrorOut` says so, and the stream goes on with the next new event.
    """
    seen = journal.last if since is None else since
    loop, news = asyncio.get_running_loop(), asyncio.Event()

    def notify(_: ContactEvent) -> None:
        with contextlib.suppress(RuntimeError):  # the loop has been closed
            loop.call_soon_threadsafe(news.set)

    end = journal.subscribe(notify)
    leaving: asyncio.Task[None] | None = None
    try:
        await websocket.accept()
        leaving = asyncio.create_task(_until_gone(websocket))
        while not leaving.done():
            news.clear()
            last = journal.last  # what comes while the file is read is not in the damaged part
            try:
                batch = await asyncio.to_thread(journal.since, seen, _BATCH)
            except JournalError as error:
                seen, batch = last, []
                refusal = ErrorOut(errors=[FieldError(field="since", reason=str(error))])
                await websocket.send_text(refusal.model_dump_json())
            for body in batch:
                await websocket.send_text(body)
                seen = json.loads(body)["id"]
            if not batch:
                waiting = asyncio.create_task(news.wait())
                await asyncio.wait({waiting, leaving}, return_when=asyncio.FIRST_COMPLETED)
                waiting.cancel()
    except (WebSocketDisconnect, RuntimeError):
        return  # the reader has disconnected while a message was being sent
    finally:
        end()
        if leaving is not None:
            leaving.cancel()
            await asyncio.gather(leaving, return_exceptions=True)


async def _until_gone(websocket: WebSocket) -> None:
    with contextlib.suppress(WebSocketDisconnect):
        while (await websocket.receive())["type"] != "websocket.disconnect":
            pass
