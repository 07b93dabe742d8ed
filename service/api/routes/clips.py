"""HTTP routes for clips of the last minutes and for recordings on request."""

import asyncio
from typing import Annotated, Any

from fastapi import APIRouter, Depends
from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection

from contactsense.service.api.clips import ClipIn, ClipOut, ClipsOut, RecordingIn, RecordingOut
from contactsense.service.api.http.errors import BODY_REFUSALS, Responses
from contactsense.service.api.http.json_route import JsonRoute
from contactsense.service.api.messages import ErrorOut

router = APIRouter(route_class=JsonRoute)
_NO_FOLDER: Responses = {
    409: {"model": ErrorOut, "description": "The service has no folder for recordings."},
}
_NO_SAMPLES: Responses = {
    503: {"model": ErrorOut, "description": "There are no samples to record: the reason says why."},
}


def _service(connection: HTTPConnection) -> Any:
    service = connection.app.state.service
    if service.clips.settings.folder is None:
        raise HTTPException(409, "the service has no folder for recordings: start it with --recordings DIR")
    return service


Shared = Annotated[Any, Depends(_service)]


def _no_samples(service: Any) -> HTTPException:
    return HTTPException(503, f"no samples to record: {service.runner.message}")


@router.post(
    "/v1/clip",
    summary="Save a clip",
    status_code=202,
    responses={**BODY_REFUSALS, **_NO_FOLDER, **_NO_SAMPLES},
)
async def clip(service: Shared, request: ClipIn) -> ClipOut:
    """Save the samples, as they were used, and their estimates in a time span around this moment to a
    file."""
    found: ClipOut | None = service.clips.order(request.before, request.after, request.reason)
    if found is None:
        raise _no_samples(service)
    return found


@router.get("/v1/clips", summary="List clips", responses=_NO_FOLDER)
async def clips(service: Shared) -> ClipsOut:
    """Clips in the service's folder, those that are being recorded, and those that failed since the service
    started; at most 1000, the latest last."""
    found = await asyncio.to_thread(service.clips.listed)
    return ClipsOut(folder=str(service.clips.settings.folder), clips=found)


@router.post(
    "/v1/recording",
    summary="Start or stop recording",
    status_code=202,
    responses={**BODY_REFUSALS, **_NO_FOLDER, **_NO_SAMPLES},
)
async def record(service: Shared, request: RecordingIn) -> RecordingOut:
    """Start or stop writing every sample to the service's folder."""
    if not service.clips.record(request.on):
        raise _no_samples(service)
    found: RecordingOut = service.clips.recording
    return found


@router.get("/v1/recording", summary="State of the recording", responses=_NO_FOLDER)
async def recording(service: Shared) -> RecordingOut:
    """Whether the service records, and how much it has recorded."""
    found: RecordingOut = service.clips.recording
    return found
