"""Source of samples that a controller pushes, in the pipeline's process."""

import contextlib
import math
import selectors
import socket
import time
from pathlib import Path

from contactsense.scene import Scene
from contactsense.service.controllers.framing import Unframer, frame
from contactsense.service.controllers.pushed_readings import PushedReadings
from contactsense.service.controllers.sample_message import MessageError, SampleDecoder, decode
from contactsense.service.controllers.track_session import error_message
from contactsense.service.sensors.checks.plausibility import RecentCounts
from contactsense.service.sensors.clients.robot_stream import StreamHealth
from contactsense.service.sensors.source_health import SourceHealth
from contactsense.types import Sample

_SILENT = 0.5
"""A controller that sends nothing for this time is reported as a problem [s]."""
_REFUSED = "refused"
_CHUNK = 1 << 16


class PushSource:
    """Listens on a Unix socket for the service, which passes on the controller's messages.

    Errors in messages are returned the same way; samples before and after are delivered.

    Args:
        scene: Determines which fields a sample has, and their lengths.
        path: Path of the socket.
    """

    def __init__(self, scene: Scene, path: Path) -> None:
        self._scene = scene
        self._decoder = SampleDecoder(scene)
        self._readings = PushedReadings(scene)
        self._refused, self._refusal = RecentCounts(), ""
        path.unlink(missing_ok=True)  # left by an earlier process
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._listener.bind(str(path))
        self._listener.listen(1)
        self._listener.setblocking(False)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._listener, selectors.EVENT_READ)
        self._connection: socket.socket | None = None
        self._unframer = Unframer()
        self._health = StreamHealth(state="waiting", error="no controller is connected to WS /v1/track")
        self._streams = 0
        self._heard = -math.inf
        self._unusable = self._without_wrench = 0
        self._base_wrench = scene.base_wrench is not None

    def poll(self, timeout: float) -> list[Sample]:
        """Return the samples that have arrived, oldest first; waits up to `timeout` seconds for the first."""
        deadline = time.monotonic() + timeout
        while True:
            ready = [key.fileobj for key, _ in self._selector.select(max(0.0, deadline - time.monotonic()))]
            # What the last controller has sent comes before the first samples of the next one.
            samples = self._read() if self._connection in ready else []
            if self._listener in ready and not samples:
                self._accept()
            now = time.monotonic()
            if samples:
                self._heard = now
            if samples or now >= deadline:
                return samples

    @property
    def streams(self) -> int:
        """How many controllers have connected. Another one has other clocks, sensors and mistakes; so may the
        same one after a pause."""
        return self._streams

    @property
    def health(self) -> SourceHealth:
        """Whether samples arrive, and how many were refused."""
        health = self._health
        if self._connection is None:
            health.state, health.error = "waiting", "no controller is connected to WS /v1/track"
        elif time.monotonic() - self._heard > _SILENT:
            health.state = "waiting"
            health.error = f"the controller at WS /v1/track has sent no usable sample for {_SILENT:g} s"
        else:
            health.state = "streaming"
        return SourceHealth(
            robot=health,
            wrench=None,
            unusable=self._unusable,
            without_wrench=self._without_wrench,
            recent=(*self._readings.trouble, *self._refusals()),
            reconnects=False,
        )

    def _refusals(self) -> tuple[str, ...]:
        """Why messages of the last second were refused; nothing for a few of them."""
        often = self._refused.totals(time.monotonic())[_REFUSED] > 2
        return (f"the controller's messages are refused, the latest one because of {self._refusal}",) * often

    def close(self) -> None:
        """Close all sockets."""
        self._drop()
        self._selector.close()
        self._listener.close()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            connection, _ = self._listener.accept()
            self._drop()
            connection.setblocking(False)
            self._selector.register(connection, selectors.EVENT_READ)
            self._connection, self._unframer = connection, Unframer()
            self._heard = time.monotonic()  # it has not been silent before it connected
            self._readings = PushedReadings(self._scene)
            self._refused, self._refusal = RecentCounts(), ""
            self._streams += 1
            self._health.connections += 1
            if self._streams > 1:
                # The number makes the error of each connection another one, with a time of its own.
                self._health.error = (
                    f"a controller has connected anew (connection {self._streams}); the estimation began anew"
                )

    def _drop(self) -> None:
        if self._connection is not None:
            self._selector.unregister(self._connection)
            self._connection.close()
            self._connection = None

    def _read(self) -> list[Sample]:
        assert self._connection is not None
        try:
            chunk = self._connection.recv(_CHUNK)
            messages = self._unframer.feed(chunk)
        except BlockingIOError:
            return []
        except (OSError, MessageError):
            chunk, messages = b"", []
        samples = []
        for message, binary in messages:
            try:
                content = decode(message, binary)
                if "scene" in content:
                    raise MessageError("scene", "expected none: samples are for the service's own scene")
                sample = self._decoder.sample(content, len(message))
            except MessageError as error:
                self._refused.add(time.monotonic(), _REFUSED)
                self._refusal = str(error)
                self._refuse(error, binary)
                continue
            try:
                sample = self._readings.checked(sample)
            except MessageError as error:
                self._refuse(error, binary)
                continue
            self._without_wrench += self._base_wrench and sample.base_wrench is None
            samples.append(sample)
        self._health.received += len(samples)
        if not chunk:
            self._drop()
        return samples

    def _refuse(self, error: MessageError, binary: bool) -> None:
        self._unusable += 1
        self._health.failures += 1
        if self._connection is not None:
            # Do not wait for a service that reads no errors; a partial message would corrupt the stream. The
            # controller may have hung up since.
            answer = frame(error_message(error, binary), binary)
            with contextlib.suppress(OSError):
                if self._connection.send(answer) < len(answer):
                    self._connection.shutdown(socket.SHUT_RDWR)
