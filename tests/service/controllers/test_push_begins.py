"""A controller gets the estimates of its own samples, however soon the pipeline accepts it."""

import asyncio
from pathlib import Path
from typing import Any

import pytest
from fastapi import WebSocketDisconnect

from contactsense import Scene
from contactsense.service.api.tracks import Tracks
from contactsense.service.controllers.settings import ControllerSettings
from contactsense.service.live.hub import Hub


class Controller:
    """The web server's side of a connection: sends nothing, and hangs up after the first answer."""

    client = None

    def __init__(self) -> None:
        self.received: list[str] = []
        self._answered = asyncio.Event()

    async def accept(self) -> None:
        pass

    async def receive(self) -> dict[str, Any]:
        await self._answered.wait()
        raise WebSocketDisconnect

    async def send_text(self, text: str) -> None:
        self.received.append(text)
        self._answered.set()

    async def close(self, code: int, reason: str) -> None:
        self._answered.set()


@pytest.mark.parametrize("accepted", ["at once", "later"])
def test_estimates_begin_when_the_pipeline_accepts(
    accepted: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings, hub = ControllerSettings(source="push"), Hub()
    monkeypatch.setattr(ControllerSettings, "socket_path", str(tmp_path / "push"))
    connect = asyncio.open_unix_connection

    async def serve() -> list[str]:
        tracks, controller, pipeline = Tracks(settings, hub), Controller(), asyncio.Event()

        async def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            pipeline.set()
            await reader.read()  # until the connection ends
            writer.close()
            await writer.wait_closed()

        async def connect_slowly(path: str) -> Any:
            """The connection exists, but this event loop does not go on before the pipeline has said so."""
            opened = await connect(path)
            await pipeline.wait()
            hub.publish(0.0, b"another controller's")
            tracks.begin_stream()
            return opened

        if accepted == "at once":
            monkeypatch.setattr(asyncio, "open_unix_connection", connect_slowly)
        server = await asyncio.start_unix_server(accept, str(tmp_path / "push"))
        async with server, asyncio.timeout(10.0):
            served = asyncio.create_task(tracks.serve(controller, Scene(robot="ur5e")))  # type: ignore[arg-type]
            await pipeline.wait()
            await asyncio.sleep(0.05)
            if accepted == "later":
                hub.publish(0.0, b"another controller's")
                tracks.begin_stream()
            hub.publish(0.002, b"its own")
            await served
        return controller.received

    assert asyncio.run(serve()) == ["its own"]
