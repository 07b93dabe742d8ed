"""The 500 Hz pipeline, in a separate process: sensors -> localizer -> service. It never waits for the
service.

A busy Python thread in the same process can delay a wake-up by many milliseconds, so this process does
nothing else. Messages that the service does not read in time wait in a bounded outbox; when it is full, the
oldest are dropped and counted.
"""

import contextlib
import json
import select
import socket
import struct
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from typing import Any, Protocol, TypeVar

from contactsense import Estimate, Localizer, Sample, Scene
from contactsense.output.degraded_reason import NEW_STREAM
from contactsense.robots.jit.compilation import Compilation
from contactsense.service.api.estimate_json import estimate_json
from contactsense.service.api.messages import PipelineHealth, SensorHealth, SourceHealth
from contactsense.service.events.summary import ContactSummaries
from contactsense.service.group_signals import leave_to_parent
from contactsense.service.live.error_times import ErrorTimes
from contactsense.service.live.listener import Listener, Reporter
from contactsense.service.live.scheduling import PIPELINE, Scheduling, prefer_low_latency, prioritize
from contactsense.service.live.step_times import StepTimes
from contactsense.service.process_argument import receive
from contactsense.service.sensors import source_health
from contactsense.service.sensors.netft_client import WrenchHealth
from contactsense.service.sensors.robot_stream import StreamHealth
from contactsense.stream_localizer import kernels_of

HEAD = struct.Struct("<cdI")
"""Header of each message: kind, time of the sample [s], number of bytes that follow."""
ESTIMATE, HEALTH, LOADING, LAST_WORDS, REPORT = b"E", b"H", b"C", b"L", b"R"
"""Kinds of messages: an estimate, the health of sensors and process, the progress of the compilation, the
error that ends the process, a report of a listener."""
HEARTBEAT = 0.25
"""Longest time between two health messages of a healthy process [s]."""

_OUTBOX = 1000
"""Messages that wait for the service at most: two seconds of estimates."""
_TICK = 0.01
"""Longest wait for samples before listeners and commands have their turn [s]."""
_MAX_COMMAND = 1 << 20
"""Largest command of the service [bytes]."""
_FAREWELL = 10.0
"""Longest time for the last words, which wait behind all other messages, to be sent [s]: a busy service reads
late."""
ANOTHER_SOURCE = f"a controller has connected anew: {NEW_STREAM}"
"""Why the estimation begins anew."""

_L = TypeVar("_L")

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


class Outbox:
    """Sends messages over a socket without ever waiting for it."""

    def __init__(self, connection: socket.socket, size: int = _OUTBOX) -> None:
        connection.setblocking(False)
        self._connection = connection
        self._size = size
        self._waiting: deque[bytes] = deque()
        self._begun = memoryview(b"")  # rest of a partly sent message
        self.dropped = 0
        """Number of dropped messages."""

    def post(self, kind: bytes, t: float, payload: bytes) -> None:
        """Send a message, or keep it until the socket accepts it. Estimates are dropped first.

        Raises:
            OSError: The other end has been closed.
        """
        if len(self._waiting) >= self._size:
            oldest = next((i for i, waiting in enumerate(self._waiting) if waiting[:1] == ESTIMATE), 0)
            del self._waiting[oldest]
            self.dropped += 1
        self._waiting.append(HEAD.pack(kind, t, len(payload)) + payload)
        self.flush()

    def flush(self) -> None:
        """Send as much as the socket accepts now."""
        while self._begun or self._waiting:
            if not self._begun:
                self._begun = memoryview(self._waiting.popleft())
            try:
                self._begun = self._begun[self._connection.send(self._begun) :]
            except BlockingIOError:
                return

    def finish(self, patience: float) -> None:
        """Send all that waits; gives up after `patience` seconds.

        Raises:
            OSError: The other end has been closed.
        """
        deadline = time.monotonic() + patience
        poller = select.poll()
        poller.register(self._connection, select.POLLOUT)
        self.flush()
        while self._begun and (left := deadline - time.monotonic()) > 0.0:
            poller.poll(left * 1e3)
            self.flush()


class Inbox:
    """Receives commands from the service: one JSON object per line.

    Args:
        connection: Connection to the service; it does not block.
        refuse: Called with the reason for each command that is left out.
    """

    def __init__(self, connection: socket.socket, refuse: Callable[[str], None]) -> None:
        self._connection = connection
        self._refuse = refuse
        self._rest = b""

    def take(self) -> list[dict[str, Any]]:
        """Return the commands that have arrived; does not wait.

        Raises:
            OSError: The service has closed the connection.
        """
        try:
            chunk = self._connection.recv(1 << 16)
        except BlockingIOError:
            return []
        if not chunk:
            raise BrokenPipeError
        *lines, rest = (self._rest + chunk).split(b"\n")
        self._rest = rest[: _MAX_COMMAND + 1]  # enough to show that the command is too long
        return [json.loads(line) for line in lines if self._accepts(line)]

    def _accepts(self, line: bytes) -> bool:
        if len(line) <= _MAX_COMMAND:
            return True
        begin = line[:40].decode(errors="replace")
        self._refuse(f"command {begin}...: expected at most {_MAX_COMMAND} bytes, got more; it is left out")
        return False


class Listeners:
    """Calls the listeners. Exceptions of a listener do not stop the pipeline.

    Args:
        listeners: The listeners, in the order in which they are called.
        outbox: Where their reports to the service are posted.
    """

    def __init__(self, listeners: Sequence[Listener], outbox: Outbox) -> None:
        self._listeners = listeners
        self._reporters = [listener for listener in listeners if isinstance(listener, Reporter)]
        self._outbox = outbox
        self.errors = 0
        """Number of exceptions so far, and of commands that were refused."""
        self.last_error = ""
        """The latest exception or refusal, as text."""

    def receive(self, sample: Sample, estimate: Estimate) -> None:
        """Pass a sample and its estimate to all listeners."""
        self._each(self._listeners, lambda listener: listener.receive(sample, estimate))
        self._send_reports(estimate.t)

    def tick(self, now: float) -> None:
        """Let all listeners do what is due at this time of the host's monotonic clock [s]."""
        self._each(self._listeners, lambda listener: listener.tick(now))
        self._send_reports(now)

    def command(self, message: dict[str, Any]) -> None:
        """Pass a command of the service to all listeners."""
        self._each(self._reporters, lambda reporter: reporter.command(message))

    def close(self) -> None:
        """Close all listeners."""
        self._each(self._listeners, lambda listener: listener.close())

    def count_error(self, text: str) -> None:
        """Count an error of the listeners or of their commands, for health."""
        self.errors += 1
        self.last_error = text

    def _each(self, listeners: Sequence[_L], call: Callable[[_L], None]) -> None:
        for listener in listeners:
            with self._counted(listener):
                call(listener)

    @contextlib.contextmanager
    def _counted(self, listener: object) -> Iterator[None]:
        try:
            yield
        except Exception as error:
            self.count_error(f"{type(listener).__name__}: {type(error).__name__}: {error}")

    def _send_reports(self, t: float) -> None:
        messages: list[bytes] = []

        def collect(reporter: Reporter) -> None:
            for report in reporter.take_reports():
                with self._counted(reporter):  # a report that is no JSON loses none of the others
                    messages.append(json.dumps(report).encode())

        self._each(self._reporters, collect)
        for message in messages:
            # The end of the service is no error of a listener.
            self._outbox.post(REPORT, t, message)


def work(
    connection: socket.socket,
    open_source: Callable[[Scene], Source],
    factories: Sequence[ListenerFactory] = (),
) -> None:
    """Main function of the pipeline's process. Returns when the service has ended.

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
                inbox = Inbox(connection, listeners.count_error)
                prefer_low_latency()
                run(source, localizer, outbox, listeners, inbox, scheduling)
        except (BrokenPipeError, ConnectionResetError):
            raise
        except Exception as error:
            traceback.print_exc()
            outbox.post(LAST_WORDS, 0.0, f"{type(error).__name__}: {error}".encode())
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
                listener_errors=listeners.errors,
                last_listener_error=listeners.last_error,
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
