"""Keeps the pipeline's process running: starts it, listens to it, starts it again when it dies or hangs."""

import asyncio
import contextlib
import json
import logging
import multiprocessing
import socket
from collections.abc import Callable
from datetime import UTC, datetime
from multiprocessing.process import BaseProcess
from typing import Literal

from contactsense import Scene
from service.messages import PipelineHealth, SourceHealth
from service.worker import ESTIMATE, HEAD, HEALTH, Source, work

log = logging.getLogger("contactsense")

Status = Literal["ok", "degraded", "starting", "waiting", "failing", "idle"]
OnEstimate = Callable[[float, bytes], None]

_FIRST_WORD = 600.0
"""Time allowed for the first start, which may compile all kernels [s]."""
_SILENCE = 10.0
"""A process that says nothing for so long hangs [s]."""
_PAUSE = (0.2, 5.0)
"""Time before the next start: at first, and at most after failing again and again [s]."""
_PATIENCE = 2.0
"""Time to end by itself [s]."""


class Runner:
    """The pipeline's process and what is known about it. Lives in one event loop."""

    def __init__(
        self, scene: Scene, open_source: Callable[[Scene], Source] | None, on_estimate: OnEstimate
    ) -> None:
        """Without `open_source` there is nothing to run.

        Args:
            scene: The arm in its place.
            open_source: Makes the source of samples; called in the process, so it must be picklable.
            on_estimate: Called with the sample's time and the estimate as JSON.
        """
        self._scene = scene
        self._open_source = open_source
        self._on_estimate = on_estimate
        self._task: asyncio.Task[None] | None = None
        self.loaded = asyncio.Event()
        """Set once the process has loaded (or failed, or there is none): kernels are compiled and cached."""
        self.source = SourceHealth()
        """The sensors' side, as last heard."""
        self.pipeline = PipelineHealth()
        """The process, as last heard."""
        self.status: Status = "idle" if open_source is None else "starting"
        """How it fares, in one word."""
        self.message = "no robot was named: only POST /v1/locate works"
        """The same in a sentence."""
        self.since = datetime.now(UTC)
        """When this status began."""
        if open_source is not None:
            self._tell("starting", "the pipeline is loading its kernels")

    def start(self) -> None:
        """Start the process and watch over it."""
        if self._open_source is None:
            self.loaded.set()
        elif self._task is None:
            self._task = asyncio.create_task(self._watch(self._open_source), name="pipeline watch")

    async def stop(self) -> None:
        """End the process."""
        if self._task is not None:
            self._task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._task
            self._task = None

    async def _watch(self, open_source: Callable[[Scene], Source]) -> None:
        pause = _PAUSE[0]
        while True:
            began = asyncio.get_running_loop().time()
            reason = await self._run_once(open_source)
            self.loaded.set()
            self.pipeline.alive = False
            self.pipeline.restarts += 1
            self.source.connected, self.source.rate = False, 0.0
            if asyncio.get_running_loop().time() - began > 60.0:
                pause = _PAUSE[0]  # it had run well
            self._tell("failing", f"the pipeline {reason}; it is started again")
            await asyncio.sleep(pause)
            pause = min(2.0 * pause, _PAUSE[1])

    async def _run_once(self, open_source: Callable[[Scene], Source]) -> str:
        """One life of the process; returns how it ended."""
        ours, theirs = socket.socketpair()
        context = multiprocessing.get_context("spawn")
        process = context.Process(
            target=work, args=(theirs, self._scene, open_source), name="contactsense pipeline", daemon=True
        )
        try:
            with theirs:
                process.start()
            reader, writer = await asyncio.open_connection(sock=ours, limit=1 << 20)
            try:
                return await self._listen(reader, process)
            finally:
                writer.close()
                with contextlib.suppress(OSError):
                    await writer.wait_closed()
        finally:
            ours.close()  # the process takes that as its end
            await asyncio.to_thread(_end, process)

    async def _listen(self, reader: asyncio.StreamReader, process: BaseProcess) -> str:
        allowed = _FIRST_WORD
        try:
            while True:
                async with asyncio.timeout(allowed):
                    kind, t, size = HEAD.unpack(await reader.readexactly(HEAD.size))
                    payload = await reader.readexactly(size)
                allowed = _SILENCE
                self.loaded.set()
                if kind == ESTIMATE:
                    self._on_estimate(t, payload)
                elif kind == HEALTH:
                    self._hear(payload)
                else:
                    return f"broke down ({payload.decode(errors='replace')})"
        except TimeoutError:
            return f"said nothing for {allowed:g} s"
        except (asyncio.IncompleteReadError, OSError):
            await asyncio.to_thread(process.join, _PATIENCE)
            return f"ended unexpectedly (exit code {process.exitcode})"

    def _hear(self, payload: bytes) -> None:
        report = json.loads(payload)
        restarts = self.pipeline.restarts
        self.source = SourceHealth.model_validate(report["source"])
        self.pipeline = PipelineHealth.model_validate(report["pipeline"])
        self.pipeline.restarts = restarts
        trouble = self.source.trouble
        if not trouble:
            self._tell("ok", "samples come and are worked on")
        elif self.source.connected:
            self._tell("degraded", f"samples come, but {trouble}; trying again all the time")
        else:
            self._tell("waiting", f"{trouble}; trying again all the time")

    @property
    def current(self) -> bool:
        """Whether estimates come."""
        return self.pipeline.alive and self.source.connected

    def _tell(self, status: Status, message: str) -> None:
        if message != self.message:
            self.message = message
            log.log(
                logging.INFO if status in ("ok", "starting") else logging.WARNING, "%s: %s", status, message
            )
        if status != self.status:
            self.status, self.since = status, datetime.now(UTC)


def _end(process: BaseProcess) -> None:
    if process.pid is None:
        return
    process.join(_PATIENCE)
    if process.is_alive():
        process.terminate()
        process.join(_PATIENCE)
    if process.is_alive():
        process.kill()
        process.join()
    process.close()
