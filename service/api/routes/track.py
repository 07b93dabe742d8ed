"""`WS /v1/track`: a controller sends its own samples and gets an estimate for each."""

from typing import Annotated

from fastapi import APIRouter, Depends, WebSocket
from starlette.requests import HTTPConnection

from contactsense.scene import Scene
from contactsense.service.api.tracks import Tracks

router = APIRouter()


def _tracks(connection: HTTPConnection) -> Tracks:
    tracks: Tracks = connection.app.state.service.tracks
    return tracks


def _scene(connection: HTTPConnection) -> Scene:
    scene: Scene = connection.app.state.service.scene
    return scene


@router.websocket("/v1/track")
async def track(
    websocket: WebSocket,
    tracks: Annotated[Tracks, Depends(_tracks)],
    scene: Annotated[Scene, Depends(_scene)],
) -> None:
    """A sample in, its estimate out, as JSON text or MessagePack; see docs/controllers.md."""
    await tracks.serve(websocket, scene)
