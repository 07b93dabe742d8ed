"""The 500 Hz pipeline, in a separate process: sensors -> localizer -> service. It never waits for the
service.

A busy Python thread in the same process can delay a wake-up by many milliseconds, so this process does
nothing else.
"""

import contextlib
import json
import socket
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from typing import Protocol

from contactsense import Estimate, Localizer, Sample, Scene
from contactsense.output.degraded_reason import NEW_STREAM
from contactsense.robots.jit.compilation import Compilation
from contactsense.service.events.summary import ContactSummaries
from contactsense.service.group_signals import leave_to_parent
from contactsense.service.live.error_times import ErrorTimes
from contactsense.service.live.estimate_json import estimate_json
from contactsense.service.live.health import PipelineHealth, SensorHealth, SourceHealth
from contactsense.service.live.listener import Listener
from contactsense.service.live.listener_calls import Listeners
from contactsense.service.live.pipeline_connection import (
    ESTIMATE,
    HEALTH,
    LAST_WORDS,
    LOADING,
    REPORT,
    Inbox,
    Outbox,
)
from contactsense.service.live.scheduling import PIPELINE, Scheduling, prefer_low_latency, prioritize
from contactsense.service.live.step_times import StepTimes
from contactsense.service.process_argument import receive
from contactsense.service.sensors import source_health
from contactsense.service.sensors.clients.netft_client import WrenchHealth
from contactsense.service.sensors.clients.robot_stream import SensorError, StreamHealth
from contactsense.service.wire.recipe import RtdeFieldError
from contactsense.stream_localizer import kernels_of

HEARTBEAT = 0.25
"""Longest time between two health messages of a healthy process [s]."""

_TICK = 0.01
"""Longest wait for samples before listeners and commands have their turn [s]."""
_FAREWELL = 10.0
"""Longest time for the last messages, which wait behind all others, to be sent [s]: a busy service reads
late."""
ANOTHER_SOURCE = f"a controller has connected anew: {NEW_STREAM}"
"""Why the estimation begins anew."""

ListenerFactory = Callable[[Scene], Listener]
"""Creates a listener; called in the pipeline's process, so it must be picklable."""


class Source(Protocol):
    """A source of samples. Problems with a sensor are reported by `health`, not raised."""

    @property
    def health(self) -> source_health.SourceHealth:
        """State of the sensors."""

    @property
    def streams(self) -> int:
        """How many streams have begun, each with a clock and sensors of its own. All samples of one `poll`
        belong to the newest."""

    def poll(self, timeout: float) -> list[Sample]:
        """Return the samples that have arrived, oldest first; waits up to `timeout` seconds for the first."""

    def close(self) -> None:
        """Disconnect from the sensors."""


class Stepper(Protocol):
    """Turns samples into estimates."""

    def step(self, sample: Sample) -> Estimate:
        """Return the estimate after this sample."""

    def restart(self, why: str) -> None:
        """Begin another stream; `why` is the reason of its first estimate."""


def work(
    connection: socket.socket,
    open_source: Callable[[Scene], Source],
    factories: Sequence[ListenerFactory] = (),
) -> None:
    """Main function of the pipeline's process. Returns when the service has ended, or sends nothing more.

    Args:
        connection: Connection to the service, which first sends the scene.
        open_source: Creates the source of samples.
        factories: Create the listeners.
    """
    leave_to_parent()
    with connection, contextlib.suppress(BrokenPipeError, ConnectionResetError):  # the service has ended
        scene: Scene = receive(connection)
        outbox = Outbox(connection)
        try:
            with _reported_loading(scene, outbox):
                localizer = Localizer(scene, progress=False)
            scheduling = prioritize(PIPELINE)  # not before kernels are compiled, which may take minutes
            with (
                contextlib.closing(open_source(scene)) as source,
                contextlib.closing(Listeners([make(scene) for make in factories], outbox)) as listeners,
            ):
                inbox = Inbox(connection, listeners.errors.add)
                prefer_low_latency()
                run(source, localizer, outbox, listeners, inbox, scheduling)
        except (BrokenPipeError, ConnectionResetError):
            outbox.finish(_FAREWELL)  # a service that sends nothing more may still read
        except Exception as error:
            text = str(error)
            # A controller that lacks a field may lack it for weeks, in each process that is started.
            if not isinstance(error, SensorError | RtdeFieldError):
                traceback.print_exc()
                text = f"{type(error).__name__}: {text}"
            outbox.post(LAST_WORDS, 0.0, text.encode())
            outbox.finish(_FAREWELL)
            sys.exit(1)


@contextlib.contextmanager
def _reported_loading(scene: Scene, outbox: Outbox) -> Iterator[None]:
    """Report progress from another thread while this one loads or compiles kernels."""
    over, lost = threading.Event(), threading.Event()
    with Compilation(kernels_of(scene)) as compilation:

        def report() -> None:
            while True:
                share, left = compilation.progress
                try:
                    outbox.post(LOADING, 0.0, json.dumps({"share": share, "left": left}).encode())
                except OSError:
                    lost.set()  # the service has ended
                    return
                if over.wait(HEARTBEAT):
                    return

        reporter = threading.Thread(target=report, name="loading report", daemon=True)
        reporter.start()
        try:
            yield
        finally:
            over.set()
            reporter.join()
    if lost.is_set():
        raise BrokenPipeError


def run(
    source: Source,
    localizer: Stepper,
    outbox: Outbox,
    listeners: Listeners | None = None,
    inbox: Inbox | None = None,
    scheduling: Scheduling = "normal",
) -> None:
    """Process samples until the connection breaks.

    Raises:
        OSError: The service no longer reads the messages.
    """
    listeners = listeners or Listeners((), outbox)
    summaries = ContactSummaries()
    beat, last_sample, step_time = 0.0, None, None
    streams = source.streams
    step_times, error_times = StepTimes(), ErrorTimes(utc_now)
    window_start, window_count, rate = time.monotonic(), 0, 0.0
    while True:
        samples = source.poll(_TICK)
        if source.streams > streams:
            if streams:
                localizer.restart(ANOTHER_SOURCE)
            streams = source.streams
            # What the service has received so far belongs to the stream before.
            outbox.post(REPORT, 0.0, json.dumps({"type": "stream"}).encode())
        estimates = []
        for sample in samples:
            begin = time.perf_counter()
            estimate = localizer.step(sample)
            took = time.perf_counter() - begin
            step_time = took if step_time is None else step_time + 0.02 * (took - step_time)
            step_times.add(took)
            listeners.receive(sample, estimate)
            estimates.append((sample, estimate))
        for sample, estimate in estimates:  # sent after all reactions
            for event in summaries.update(estimate, utc_now()):
                report = {"type": "event", "event": event.model_dump()}
                outbox.post(REPORT, estimate.t, json.dumps(report).encode())
            outbox.post(ESTIMATE, estimate.t, estimate_json(estimate, sample.q))
        now = time.monotonic()
        for command in inbox.take() if inbox is not None else ():
            listeners.command(command)
        listeners.tick(now)
        window_count += len(samples)
        if samples:
            last_sample = now
        if now - window_start >= 1.0:
            rate = window_count / (now - window_start)
            window_start, window_count = now, 0
        if now - beat >= HEARTBEAT:
            beat = now
            health = _as_message(source.health, error_times)
            health.rate = rate
            health.age = None if last_sample is None else now - last_sample
            pipeline = PipelineHealth(
                alive=True,
                scheduling=scheduling,
                dropped=outbox.dropped,
                step=step_time,
                listener_errors=listeners.errors.count,
                last_listener_error=listeners.errors.last,
                step_counts=step_times.counts,
                step_sum=step_times.total,
            )
            report = {"source": health.model_dump(), "pipeline": pipeline.model_dump()}
            outbox.post(HEALTH, now, json.dumps(report).encode())
        else:
            outbox.flush()


def utc_now() -> str:
    """Current time on the host's clock, ISO 8601 in UTC."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def _as_message(health: source_health.SourceHealth, error_times: ErrorTimes) -> SourceHealth:
    def sensor(name: str, stream: StreamHealth | WrenchHealth) -> SensorHealth:
        return SensorHealth(
            state=stream.state,
            received=stream.received,
            lost=stream.lost,
            last_error=stream.error,
            last_error_time=error_times.time_of(name, stream),
        )

    return SourceHealth(
        connected=health.robot.state == "streaming",
        trouble=health.trouble_while_running,
        without_wrench=health.without_wrench,
        unusable=health.unusable,
        robot=sensor("robot", health.robot),
        base_wrench=None if health.wrench is None else sensor("base_wrench", health.wrench),
        link_wrenches={
            name.removeprefix("link_wrenches."): sensor(name, stream) for name, stream in health.links.items()
        },
    )
