"""Connections of controllers that send their own samples and get an estimate for each: `WS /v1/track`."""

import asyncio
import contextlib
import json
import logging
from collections.abc import Coroutine
from typing import Any

from fastapi import WebSocket, WebSocketDisconnect

from contactsense.scene import Scene
from contactsense.service.controllers.sample_message import MAX_SCENE, MessageError, encode
from contactsense.service.controllers.settings import ControllerSettings
from contactsense.service.controllers.track_process import MessageChannel, TrackProcess
from contactsense.service.controllers.track_session import error_message
from contactsense.service.live.hub import Hub, Reader
from contactsense.service.live.scheduling import WEB, deprioritize, prioritize

log = logging.getLogger("contactsense")
TRY_AGAIN, RESTARTED, NORMAL = 1013, 1012, 1000
"""Close codes of RFC 6455 and its registry."""


class Tracks:
    """Connections of `WS /v1/track`.

    Args:
        settings: Largest number of connections, and whether they feed the pipeline.
        hub: The pipeline's estimates.
    """

    def __init__(self, settings: ControllerSettings, hub: Hub) -> None:
        self._settings = settings
        self._hub = hub
        self.opened = 0
        """Number of open connections."""
        self._pushed: _Pushed | None = None

    def begin_stream(self) -> None:
        """The pipeline has accepted the controller: estimates so far are of another one's samples."""
        if self._pushed is not None:
            self._pushed.begin()

    async def serve(self, websocket: WebSocket, scene: Scene) -> None:
        """Serve one connection until it ends."""
        await websocket.accept()
        push = self._settings.source == "push"
        most = 1 if push else self._settings.tracks
        if self.opened >= most:
            what = (
                "another controller is the source of the samples"
                if push
                else f"expected at most {most} connections, all are taken"
            )
            await _refuse(websocket, MessageError("", what), TRY_AGAIN)
            return
        self.opened += 1
        # Each sample now passes through this event loop. Without a controller it gets no real time: a flood
        # of requests to the service would take processor time from all other programs on this computer.
        prioritize(WEB, reset_on_fork=True)
        try:
            if push:
                await self._push(websocket)
            else:
                async with TrackProcess(scene) as process:
                    await _first(
                        self._forward(websocket, process.channel), _answer(websocket, process.channel)
                    )
                    # The process has ended while the controller is connected: report it.
                    await _close(websocket, 1011, "the localizer's process has ended")
        except (WebSocketDisconnect, RuntimeError):
            pass  # the controller has disconnected
        finally:
            self.opened -= 1
            if self.opened == 0:
                deprioritize()

    async def _push(self, websocket: WebSocket) -> None:
        with self._hub.subscribe() as reader:
            # Before the pipeline can accept the connection and say so.
            self._pushed = _Pushed(reader)
            try:
                try:
                    opened = await asyncio.open_unix_connection(self._settings.socket_path)
                except OSError:
                    reason = "the pipeline is still starting; connect again in a moment"
                    await _refuse(websocket, MessageError("", reason), TRY_AGAIN)
                    return
                await self._feed(websocket, MessageChannel(*opened), self._pushed)
            finally:
                self._pushed = None

    async def _feed(self, websocket: WebSocket, channel: MessageChannel, pushed: "_Pushed") -> None:
        """Feed the pipeline with the controller's messages until one of them ends the connection."""
        form = _Form()
        who = "a controller" if websocket.client is None else f"a controller at {websocket.client.host}"
        log.info("%s sends the samples from now on: a new stream begins", who)
        try:
            await _first(
                self._forward(websocket, channel, form),
                _answer(websocket, channel),
                _estimates(websocket, form, pushed),
            )
            await _close(websocket, RESTARTED, "the pipeline is being restarted; connect again")
        finally:
            log.info("%s sends no more samples: its connection has ended", who)
            await channel.close()

    async def _forward(
        self, websocket: WebSocket, channel: MessageChannel, form: "_Form | None" = None
    ) -> None:
        """Pass on the controller's messages."""
        while True:
            try:
                async with asyncio.timeout(self._settings.idle):
                    message = await websocket.receive()
            except TimeoutError:
                await _close(websocket, NORMAL, f"nothing has come for {self._settings.idle:g} s")
                raise WebSocketDisconnect(NORMAL) from None
            if message["type"] == "websocket.disconnect":
                raise WebSocketDisconnect(NORMAL)
            data, text = message.get("bytes"), message.get("text")
            binary = data is not None
            content = data if data is not None else (text or "").encode()
            if form is not None:
                form.binary = binary
            if len(content) > MAX_SCENE:
                error = MessageError("", f"expected at most {MAX_SCENE} bytes, got {len(content)}")
                await _send(websocket, error_message(error, binary), binary)
                continue
            try:
                await channel.send(content, binary)
            except OSError:
                return


class _Form:
    """Format of a controller's messages: JSON or MessagePack."""

    binary = False


class _Pushed:
    """The estimates of one controller's samples, which begin where the pipeline says so."""

    def __init__(self, reader: Reader) -> None:
        self.reader = reader
        self.begun = asyncio.Event()

    def begin(self) -> None:
        self.reader.clear()
        self.begun.set()


async def _estimates(websocket: WebSocket, form: _Form, pushed: _Pushed) -> None:
    """Pass on the pipeline's estimates, in the format of the controller's messages."""
    await pushed.begun.wait()
    while True:
        message = await pushed.reader.take()
        lost = pushed.reader.take_lost()
        for text in ([b'{"lost":%d}' % lost] if lost else []) + [message]:
            answer = encode(json.loads(text), True) if form.binary else text
            await _send(websocket, answer, form.binary)


async def _answer(websocket: WebSocket, channel: MessageChannel) -> None:
    """Pass on the answers of the process until it ends."""
    with contextlib.suppress(EOFError):
        while True:
            message, binary = await channel.receive()
            await _send(websocket, message, binary)


async def _first(*works: Coroutine[Any, Any, None]) -> None:
    """Wait until one of the coroutines ends, cancel the others, and re-raise its exception."""
    tasks = [asyncio.create_task(work) for work in works]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    for task in done:
        task.result()


async def _send(websocket: WebSocket, message: bytes, binary: bool) -> None:
    if binary:
        await websocket.send_bytes(message)
    else:
        await websocket.send_text(message.decode())


async def _refuse(websocket: WebSocket, error: MessageError, code: int) -> None:
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):
        await _send(websocket, error_message(error, False), False)
    await _close(websocket, code, str(error))


async def _close(websocket: WebSocket, code: int, reason: str) -> None:
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):
        await websocket.close(code, reason.encode()[:123].decode(errors="ignore"))
