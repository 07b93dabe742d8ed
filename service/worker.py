"""The 500 Hz pipeline, in a process of its own: sensors -> localizer -> service, for which it never waits.

A busy Python thread in the same process can delay a wake-up by many milliseconds, so this process does
nothing else. What the service does not take in time piles up in a bounded outbox, then the oldest messages
are dropped and counted.
"""

import contextlib
import json
import signal
import socket
import struct
import sys
import time
import traceback
from collections import deque
from collections.abc import Callable
from typing import Protocol

from contactsense import Estimate, Localizer, Sample, Scene
from service.messages import PipelineHealth, SensorHealth, SourceHealth, estimate_json
from service.sensors import source as live
from service.sensors.netft import WrenchHealth
from service.sensors.streams import StreamHealth

HEAD = struct.Struct("<cdI")
"""In front of each message: kind, time of the sample [s], bytes that follow."""
ESTIMATE, HEALTH, LAST_WORDS = b"E", b"H", b"L"
HEARTBEAT = 0.25
"""Longest time between two health messages while the process is well [s]."""

_OUTBOX = 1000


class Source(Protocol):
    """Where samples come from. Trouble with a sensor is told in `health`, not raised."""

    @property
    def health(self) -> live.SourceHealth:
        """How the sensors fare."""

    def poll(self, timeout: float) -> list[Sample]:
        """Samples that have come, oldest first; waits up to `timeout` seconds for the first."""

    def close(self) -> None:
        """Let go of the sensors."""


class Stepper(Protocol):
    """What turns samples into estimates."""

    def step(self, sample: Sample) -> Estimate:
        """The estimate after this sample."""


class Outbox:
    """Messages on their way into a socket, without ever waiting for it."""

    def __init__(self, connection: socket.socket, size: int = _OUTBOX) -> None:
        connection.setblocking(False)
        self._connection = connection
        self._size = size
        self._waiting: deque[bytes] = deque()
        self._begun = memoryview(b"")  # rest of a message of which a part has gone
        self.dropped = 0
        """Messages given up."""

    def post(self, kind: bytes, t: float, payload: bytes) -> None:
        """Send a message, or keep it until the socket takes it.

        Raises:
            OSError: Nobody is at the other end any more.
        """
        if len(self._waiting) >= self._size:
            self._waiting.popleft()
            self.dropped += 1
        self._waiting.append(HEAD.pack(kind, t, len(payload)) + payload)
        self.flush()

    def flush(self) -> None:
        """Send what the socket takes now."""
        while self._begun or self._waiting:
            if not self._begun:
                self._begun = memoryview(self._waiting.popleft())
            try:
                self._begun = self._begun[self._connection.send(self._begun) :]
            except BlockingIOError:
                return


def work(connection: socket.socket, scene: Scene, open_source: Callable[[Scene], Source]) -> None:
    """Body of the pipeline's process. Ends when the service has gone.

    Args:
        connection: Way to the service.
        scene: The arm in its place.
        open_source: Makes the source of samples.
    """
    signal.signal(
        signal.SIGINT, signal.SIG_IGN
    )  # Ctrl-C reaches the whole group; the service ends us in order
    outbox = Outbox(connection)
    with connection, contextlib.suppress(BrokenPipeError, ConnectionResetError):  # the service has gone
        try:
            with contextlib.closing(open_source(scene)) as source:
                run(source, Localizer(scene), outbox)
        except (BrokenPipeError, ConnectionResetError):
            raise
        except Exception as error:
            traceback.print_exc()
            outbox.post(LAST_WORDS, 0.0, f"{type(error).__name__}: {error}".encode())
            sys.exit(1)


def run(source: Source, localizer: Stepper, outbox: Outbox) -> None:
    """Step through samples for ever.

    Raises:
        OSError: Nobody takes the messages any more.
    """
    beat, last_sample, step_time = 0.0, None, None
    window_start, window_count, rate = time.monotonic(), 0, 0.0
    while True:
        samples = source.poll(HEARTBEAT / 2)
        for sample in samples:
            begin = time.perf_counter()
            estimate = localizer.step(sample)
            took = time.perf_counter() - begin
            step_time = took if step_time is None else step_time + 0.02 * (took - step_time)
            outbox.post(ESTIMATE, estimate.t, estimate_json(estimate))
        now = time.monotonic()
        window_count += len(samples)
        if samples:
            last_sample = now
        if now - window_start >= 1.0:
            rate = window_count / (now - window_start)
            window_start, window_count = now, 0
        if now - beat >= HEARTBEAT:
            beat = now
            health = _told(source.health)
            health.rate = rate
            health.age = None if last_sample is None else now - last_sample
            pipeline = PipelineHealth(alive=True, dropped=outbox.dropped, step=step_time)
            report = {"source": health.model_dump(), "pipeline": pipeline.model_dump()}
            outbox.post(HEALTH, now, json.dumps(report).encode())
        else:
            outbox.flush()


def _told(health: live.SourceHealth) -> SourceHealth:
    def sensor(stream: StreamHealth | WrenchHealth) -> SensorHealth:
        return SensorHealth(
            state=stream.state, received=stream.received, lost=stream.lost, last_error=stream.error
        )

    return SourceHealth(
        connected=health.robot.state == "streaming",
        trouble=health.trouble,
        without_wrench=health.without_wrench,
        robot=sensor(health.robot),
        base_wrench=None if health.wrench is None else sensor(health.wrench),
    )
