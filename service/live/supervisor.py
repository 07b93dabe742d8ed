"""Keeps the pipeline's process running: starts it, reads its messages, restarts it when it dies or hangs.

The status is computed from ages at each request, because a stored status would outlive the process that set
it.
"""

import asyncio
import contextlib
import errno
import json
import logging
import multiprocessing
import os
import socket
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from multiprocessing.process import BaseProcess
from typing import Any, Literal

from contactsense import Scene
from contactsense.plausibility.stream_start import FROM_START
from contactsense.service.live.error_count import ErrorCount
from contactsense.service.live.health import PipelineHealth, SourceHealth
from contactsense.service.live.latest_estimate import LatestEstimate
from contactsense.service.live.loading import Loading, OnLoading
from contactsense.service.live.pipeline_connection import (
    ESTIMATE,
    HEAD,
    HEALTH,
    LAST_WORDS,
    LOADING,
    REPORT,
)
from contactsense.service.live.pipeline_process import ListenerFactory, Source, work
from contactsense.service.live.process_exit import ask_to_end, end, exit_code
from contactsense.service.live.silence import TICK, Silence, process_state
from contactsense.service.live.status import STALE, Facts, Status, assess
from contactsense.service.live.status_log import StatusLog
from contactsense.service.live.supervision import Supervised
from contactsense.service.process_argument import packed

log = logging.getLogger("contactsense")

OnEstimate = Callable[[float, bytes], None]
OnReport = Callable[[dict[str, Any]], None]

_FIRST_WORD = 300.0
"""Time allowed for a process to start [s]."""
_STUCK = 300.0
"""A compilation without progress for this time counts as hung [s]."""
_LOADING_SILENCE = 10.0
"""A process that loads kernels may hold its interpreter for some seconds, but not longer than this [s]."""
_SILENCE = 1.5
"""A process that sends nothing for this time counts as hung [s]."""
_STOPPED = 0.8
"""A process that is stopped for this time is killed and restarted [s]; so it is reported within a second."""
_LATE = 1.0
"""A delay of the event loop beyond this is reported [s]."""
_PAUSE = (0.2, 5.0)
"""Time before a restart: after the first failure, and at most after repeated failures [s]."""
_NAMES = {ESTIMATE: "estimate", HEALTH: "health", LOADING: "progress", REPORT: "report"}
"""Kinds of messages in words."""


class Runner:
    """The pipeline's process and what is known about it. Used from one event loop."""

    def __init__(
        self,
        scene: Scene,
        open_source: Callable[[Scene], Source] | None,
        on_estimate: OnEstimate,
        on_report: OnReport | None = None,
        listeners: Sequence[ListenerFactory] = (),
        on_loading: OnLoading | None = None,
    ) -> None:
        """Create the runner; without `open_source` no process is started.

        Args:
            scene: The arm in its cell.
            open_source: Creates the source of samples; called in the process, so it must be picklable.
            on_estimate: Called with the time of the sample and the estimate as JSON.
            on_report: Called with the reports of the listeners, events included.
            listeners: Create the listeners in the process; must be picklable.
            on_loading: Called with the progress while kernels are compiled.
        """
        self._scene = scene
        self._open_source = open_source
        self._on_estimate = on_estimate
        self._on_report = on_report
        self._listeners = tuple(listeners)
        self._to_pipeline: asyncio.StreamWriter | None = None
        self._task: Supervised | None = None
        self._ticker: Supervised | None = None
        self._process: Literal["none", "starting", "running", "ended"] = "starting"
        self._end_reason = ""
        self._reported = self._estimated = self._sampled = 0.0
        self._latest = LatestEstimate()
        self._lag = 0.0
        self._restart = asyncio.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self.loaded = asyncio.Event()
        """Set when the process has loaded, that is, kernels are compiled and cached; also when it has failed
        or there is none."""
        self.loading = Loading(on_loading, 1.0 if open_source is None else 0.0)
        """Progress of the compilation of kernels."""
        self.source = SourceHealth()
        """State of the sensors, as last reported."""
        self.pipeline = PipelineHealth()
        """State of the process, as last reported."""
        self.estimates = 0
        """Number of estimates received since the service started."""
        self.handover: float | None = None
        """Transfer time of the latest report from the process to the service [s]."""
        # The process is healthy, and its next messages must not be lost.
        self.message_errors = ErrorCount(
            lambda text: log.exception("a message of the pipeline could not be handled: %s", text)
        )
        """Messages of the process that could not be handled: kind of message, then the exception."""
        self._last_status: Status = "starting"
        self._status_log = StatusLog()
        self.others: Callable[[], Sequence[str]] = tuple
        """Returns other problems in the service, each a sentence."""
        self.on_end: Callable[[], None] | None = None
        """Called when the process has ended and its last message has been handled."""
        self.since = datetime.now(UTC)
        """Time since which the service has had this status."""
        if open_source is None:
            self._process = "none"

    def start(self) -> None:
        """Start the process and supervise it."""
        self._look()
        if self._open_source is None:
            self.loaded.set()
        elif self._task is None:
            self._loop = asyncio.get_running_loop()
            self._task = Supervised("pipeline supervision", self._watch)
            self._ticker = Supervised("status watch", self._tick)
            self._task.start()
            self._ticker.start()

    async def stop(self) -> None:
        """End the process."""
        for task in (self._ticker, self._task):
            if task is not None:
                await task.stop()
        self._task = self._ticker = None

    def restart(
        self,
        scene: Scene,
        open_source: Callable[[Scene], Source] | None,
        listeners: Sequence[ListenerFactory] = (),
    ) -> None:
        """Restart the process with another scene and other listeners."""
        self._scene, self._open_source, self._listeners = scene, open_source, tuple(listeners)
        self._restart.set()

    def send(self, command: dict[str, Any]) -> bool:
        """Send a command to the listeners; returns False if no pipeline runs."""
        if self._to_pipeline is None:
            return False
        self._to_pipeline.write(json.dumps(command).encode() + b"\n")
        return True

    async def _watch(self) -> None:
        pause = _PAUSE[0]
        while self._open_source is not None:
            began = asyncio.get_running_loop().time()
            self._restart.clear()
            self._process = "starting"
            try:
                reason = await self._run_once(self._open_source)
            except OSError as error:
                reason = f"could not be started: {error.strerror or error}{_advice(error)}"
            self.loading.end()
            self.loaded.set()
            if self.on_end is not None:
                self.on_end()
            self.pipeline.alive = False
            self.pipeline.restarts += 1
            self.source.connected, self.source.rate = False, 0.0
            if self._restart.is_set():
                self._process, self._end_reason = "starting", ""
                pause = _PAUSE[0]
                continue
            self._process, self._end_reason = "ended", reason
            self._look()
            if asyncio.get_running_loop().time() - began > 60.0:
                pause = _PAUSE[0]  # it had run without failure
            await asyncio.sleep(pause)
            pause = min(2.0 * pause, _PAUSE[1])

    async def _tick(self) -> None:
        """Check the status so often that no change is missed."""
        clock = asyncio.get_running_loop().time
        while True:
            begin = clock()
            await asyncio.sleep(TICK)
            self._lag = clock() - begin - TICK
            if self._lag > _LATE:
                log.warning("the service did not run for %.1f s: is this computer overloaded?", self._lag)
            self._look()

    async def _run_once(self, open_source: Callable[[Scene], Source]) -> str:
        """Run the process once; returns how it ended."""
        ours, theirs = socket.socketpair()
        context = multiprocessing.get_context("spawn")
        hung = False
        process = context.Process(
            target=work,
            args=(theirs, open_source, self._listeners),
            name="contactsense pipeline",
            daemon=True,
        )
        try:
            with theirs:
                process.start()
            reader, writer = await asyncio.open_connection(sock=ours, limit=1 << 20)
            writer.write(packed(self._scene))
            self._to_pipeline = writer
            try:
                reason, hung = await self._listen(reader, process)
                return reason
            finally:
                self._to_pipeline = None
                writer.transport.abort()  # `close` would wait until a process that hangs has read the rest
                with contextlib.suppress(OSError):
                    await writer.wait_closed()
        finally:
            ours.close()  # the process ends when its connection is closed
            await end(process, at_once=hung)

    async def _listen(self, reader: asyncio.StreamReader, process: BaseProcess) -> tuple[str, bool]:
        """Read messages until the process ends, hangs or is to be restarted. Returns the reason, and whether
        to kill it at once."""
        clock = asyncio.get_running_loop().time
        silence = Silence(clock(), os.sysconf("SC_CLK_TCK"))
        self.loading.begin()
        receiving = asyncio.create_task(self._receive(reader, process, silence))
        try:
            while not receiving.done():
                await asyncio.wait({receiving}, timeout=TICK)
                silence.tick(clock(), process_state(process.pid or 0))
                allowed = self._allowed_silence()
                if receiving.done():
                    break
                if self._restart.is_set():
                    # It is asked for, and no failure; the process may take some time to end.
                    self._process, self._end_reason = "starting", ""
                    writer, self._to_pipeline = self._to_pipeline, None
                    return "was ended for a new scene", not await ask_to_end(writer, receiving)
                if silence.stopped > _STOPPED:
                    return f"was stopped, or dead, for {_STOPPED:g} s", True
                if self.loading.advanced is not None and clock() - self.loading.advanced > _STUCK:
                    return f"made no progress compiling its kernels for {_STUCK:g} s", True
                if silence.seconds > allowed:
                    return f"was silent for {allowed:g} s", True
            return receiving.result(), False
        finally:
            receiving.cancel()
            await asyncio.wait([receiving])

    async def _receive(self, reader: asyncio.StreamReader, process: BaseProcess, silence: Silence) -> str:
        """Take messages until the process ends; returns how it ended."""
        clock = asyncio.get_running_loop().time
        while True:
            try:
                kind, t, size = HEAD.unpack(await reader.readexactly(HEAD.size))
                payload = await reader.readexactly(size)
            except (asyncio.IncompleteReadError, OSError):
                return f"ended unexpectedly (exit code {await exit_code(process)})"
            silence.reset()
            self._reported = clock()
            if kind == LAST_WORDS:
                return f"failed ({payload.decode(errors='replace')})"
            if kind != LOADING:
                self.loaded.set()
                with self.message_errors.catching(_NAMES[LOADING]):
                    self.loading.end()
            with self.message_errors.catching(_NAMES[kind]):
                self._take(kind, t, payload)

    def _take(self, kind: bytes, t: float, payload: bytes) -> None:
        """Handle a message; `t` is the time in its header [s]."""
        if kind == LOADING:
            self.loading.take(payload, self._reported)
        elif kind == ESTIMATE:
            self._estimated = self._reported
            self._latest.take(self._estimated, payload)
            self.estimates += 1
            self._on_estimate(t, payload)
        elif kind == HEALTH:
            self._take_health(payload, t)
        elif self._on_report is not None:
            self._on_report(json.loads(payload))

    def _allowed_silence(self) -> float:
        if self._process != "starting":
            return _SILENCE
        return _FIRST_WORD if self.loading.advanced is None else _LOADING_SILENCE

    def _take_health(self, payload: bytes, sent: float) -> None:
        if not self._restart.is_set():  # one that is to be replaced only reports its end
            self._process, self._end_reason = "running", ""
        report = json.loads(payload)
        restarts = self.pipeline.restarts
        self.source = SourceHealth.model_validate(report["source"])
        if self.source.age is not None:
            # Other messages, such as the progress of the next process, must not make this age look new.
            self._sampled = self._reported - self.source.age
        self.pipeline = PipelineHealth.model_validate(report["pipeline"])
        self.pipeline.restarts = restarts
        self.handover = max(0.0, asyncio.get_running_loop().time() - sent)

    @property
    def status(self) -> Status:
        """Present state of the service."""
        return self._look()[0]

    @property
    def reasons(self) -> tuple[str, ...]:
        """Reasons for the status, each a sentence."""
        return self._look()[1]

    @property
    def message(self) -> str:
        """The reasons in one line."""
        return "; ".join(self.reasons)

    @property
    def report_age(self) -> float | None:
        """Time since the latest message from the process [s]; None before the first."""
        return self._age(self._reported)

    @property
    def estimate_age(self) -> float | None:
        """Time since the latest estimate arrived [s]; None before the first."""
        return self._age(self._estimated)

    @property
    def sample_age(self) -> float | None:
        """Time since the latest sample [s]; None before the first."""
        # Estimates arrive more often than reports, and there is one for each sample.
        return self._age(max(self._sampled, self._estimated))

    @property
    def lag(self) -> float:
        """Delay of the event loop at the last check [s]."""
        return self._lag

    @property
    def current(self) -> bool:
        """Whether the latest estimate is current."""
        age = self.estimate_age
        return self.status in ("ok", "degraded") and age is not None and age <= STALE

    def _age(self, then: float) -> float | None:
        return None if not then or self._loop is None else max(0.0, self._loop.time() - then)

    def _look(self) -> tuple[Status, tuple[str, ...]]:
        """Compute the status; log it if it is news."""
        failing = [task for task in (self._task, self._ticker) if task is not None and task.error]
        found = assess(
            Facts(
                process=self._process,
                loading=str(self.loading),
                end=self._end_reason,
                report_age=self.report_age or 0.0,
                sample_age=self.sample_age,
                estimate_age=self.estimate_age,
                connected=self.source.connected,
                trouble=(self.source.trouble,) if self.source.trouble else (),
                # Where the latest one is old, its age is what counts.
                estimate=self._latest.degraded(self._estimated + (self.estimate_age or 0.0)),
                doubt=FROM_START if FROM_START.encode() in self._latest.payload else "",
                others=(
                    *(f"{task.name} had to be started again: {task.error}" for task in failing),
                    *self.others(),
                ),
            )
        )
        status, reasons = found
        if status != self._last_status:
            self._last_status = status
            self.since = datetime.now(UTC)
        news = self._status_log.news(status, reasons, time.monotonic())
        if news:
            level = logging.INFO if status in ("ok", "starting", "idle") else logging.WARNING
            log.log(level, "%s: %s", status, news)
        return found


def _advice(error: OSError) -> str:
    if error.errno in (errno.EMFILE, errno.ENFILE):
        return "; raise the limit of open files (ulimit -n, LimitNOFILE in the unit file)"
    return ""
