"""Our own RTDE reader: it receives every packet of the robot, in order.

`RtdeConnection` is one connection and raises on errors; `RtdeStream` keeps one open and reconnects.
"""

import select
import socket
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import TypeVar

from contactsense.service.sensors.clients.host_names import HostName
from contactsense.service.sensors.clients.robot_stream import (
    Backoff,
    LossCounter,
    RobotRecord,
    SensorError,
    StreamHealth,
)
from contactsense.service.sensors.clients.silence_timer import SilenceTimer
from contactsense.service.wire import rtde as wire

DEFAULT_PORT = 30004

_CHUNK = 1 << 16
_R = TypeVar("_R")


class RtdeConnection:
    """One connection to a controller that is sending.

    Args:
        host: Address of the robot.
        fields: Requested RTDE fields; `timestamp` is prepended if it is missing.
        port: TCP port.
        frequency: Packet rate [Hz]; controllers send at most 500 (e-Series) or 125.
        timeout: Maximum wait for the connection and for each answer during setup [s].
        silence: Maximum time without a complete packet once data arrives [s]; time in which the host stood
            still does not count.
        address: Address of `host`, if it is already known.

    Raises:
        SensorError: There is no robot, or it does not answer or refuses the request.
        RtdeFieldError: The robot does not know a field; the message names it.
        RtdeProtocolError: The server does not speak RTDE.
    """

    def __init__(
        self,
        host: str,
        fields: Sequence[str],
        *,
        port: int = DEFAULT_PORT,
        frequency: float = 500.0,
        timeout: float = 1.0,
        silence: float = 0.5,
        address: str | None = None,
    ) -> None:
        self._place = f"robot at {host}:{port}"
        self._silence = silence
        self._timeout = timeout
        self._decoder = wire.FrameDecoder()
        self._pending: wire.RtdeProtocolError | None = None
        self._first = True
        names = tuple(fields) if "timestamp" in fields else ("timestamp", *fields)
        try:
            self._socket = socket.create_connection((address or host, port), timeout)
        except OSError as error:
            raise SensorError(f"{self._place} cannot be reached: {_reason(error)}") from None
        try:
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._set_up(names, frequency)
        except BaseException:
            self._socket.close()
            raise
        self._socket.setblocking(False)
        self._poller = select.poll()
        self._poller.register(self._socket, select.POLLIN)
        self._connected_ns = time.monotonic_ns()
        self._timer = SilenceTimer(self._connected_ns)

    def _set_up(self, names: tuple[str, ...], frequency: float) -> None:
        agreed = self._ask(wire.ProtocolVersionRequest(), wire.ProtocolVersionReply)
        if not agreed.accepted:
            raise SensorError(f"{self._place} does not speak RTDE version {wire.PROTOCOL_VERSION}")
        setup = self._ask(wire.OutputSetup(frequency, names), wire.SetupReply)
        self.recipe = wire.Recipe(setup.recipe_id, names, setup.types)
        """Layout of the packets."""
        if self.recipe.types[names.index("timestamp")] != "DOUBLE":
            raise wire.RtdeProtocolError("expected the timestamp to be a DOUBLE")
        self._time_at = self.recipe.slices["timestamp"].start
        self._decoder.expect_data_size(self.recipe.size)
        if not self._ask(wire.Start(), wire.StartReply).accepted:
            raise SensorError(f"{self._place} refuses to start sending")

    def _ask(self, request: wire.Request, expected: type[_R]) -> _R:
        what = type(request).__name__
        deadline = time.monotonic() + self._timeout
        try:
            self._socket.settimeout(self._timeout)
            self._socket.sendall(wire.encode(request))
            while True:
                frame = self._decoder.next_frame()
                if frame is None:
                    self._socket.settimeout(max(1e-3, deadline - time.monotonic()))
                    chunk = self._socket.recv(_CHUNK)
                    if not chunk:
                        raise SensorError(f"{self._place} closed the connection upon {what}")
                    self._decoder.feed(chunk)
                    if time.monotonic() > deadline:
                        raise TimeoutError
                    continue
                reply = wire.parse_reply(frame)
                if isinstance(reply, expected):
                    return reply
                if not isinstance(reply, wire.TextMessage | wire.Data):
                    raise wire.RtdeProtocolError(f"expected {expected.__name__} upon {what}, got {reply}")
        except TimeoutError:
            raise SensorError(
                f"{self._place} accepts connections but gave no answer to {what} within {self._timeout:g} s"
            ) from None
        except OSError as error:
            raise SensorError(f"{self._place}: connection lost upon {what}: {_reason(error)}") from None

    def read(self, timeout: float) -> list[RobotRecord]:
        """Packets received, oldest first; waits up to `timeout` seconds for the first.

        Raises:
            SensorError: The robot closed the connection, or sent no complete packet for too long.
            RtdeProtocolError: The bytes are not valid RTDE; packets before the bad one were delivered.
        """
        if self._pending is not None:
            raise self._pending
        if self._first:
            # Packets may have arrived together with the answer to the start request.
            self._first = False
            records = self._decode(self._connected_ns)
            if records:
                return records
        if self._poller.poll(timeout * 1e3):
            chunk = self._receive()
            arrival = time.monotonic_ns()
            self._decoder.feed(chunk)
            records = self._decode(arrival)
            if records:
                self._timer.heard(arrival)
                return records
        if self._timer.nothing(time.monotonic_ns(), timeout) > self._silence:
            raise SensorError(f"{self._place} has been silent for {self._silence:g} s")
        return []

    def _receive(self) -> bytes:
        try:
            chunk = self._socket.recv(_CHUNK)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise SensorError(f"{self._place}: connection lost: {_reason(error)}") from None
        if not chunk:
            raise SensorError(f"{self._place} closed the connection")
        return chunk

    def _decode(self, arrival: int) -> list[RobotRecord]:
        records: list[RobotRecord] = []
        unpack, time_at = self.recipe.unpack, self._time_at
        try:
            while (frame := self._decoder.next_frame()) is not None:
                if frame.kind == wire.DATA:
                    values = unpack(frame.payload)
                    records.append(RobotRecord(values[time_at], arrival, values))
        except wire.RtdeProtocolError as error:
            # Good packets before the bad one are delivered first.
            self._pending = error
            if not records:
                raise
        return records

    def close(self) -> None:
        """Hang up."""
        self._socket.close()


class _Attempt(threading.Thread):
    """One attempt to connect, in a thread: a host that does not answer takes seconds to find out."""

    def __init__(self, connect: Callable[[], RtdeConnection]) -> None:
        super().__init__(name="rtde connect", daemon=True)
        self._connect = connect
        self._lock = threading.Lock()
        self._abandoned = False
        self._result: RtdeConnection | Exception | None = None
        self.start()

    def run(self) -> None:
        """Connect; nobody may want the connection any more."""
        result: RtdeConnection | Exception
        try:
            result = self._connect()
        except Exception as error:
            result = error
        with self._lock:
            self._result = result
            if self._abandoned and isinstance(result, RtdeConnection):
                result.close()

    def result(self, timeout: float) -> RtdeConnection | None:
        """The connection; None where it takes longer than `timeout` seconds."""
        self.join(timeout)
        if isinstance(self._result, Exception):
            raise self._result
        return self._result

    def abandon(self) -> None:
        """Close the connection as soon as there is one."""
        with self._lock:
            self._abandoned = True
            if isinstance(self._result, RtdeConnection):
                self._result.close()


class RtdeStream:
    """An endless stream of robot records: connects, reads, and after any error retries at growing intervals.

    Arguments as for `RtdeConnection`. It connects at the first `poll`, and no `poll` blocks for longer than
    its timeout: threads resolve names and open connections.
    """

    def __init__(
        self,
        host: str,
        fields: Sequence[str],
        *,
        port: int = DEFAULT_PORT,
        frequency: float = 500.0,
        timeout: float = 1.0,
        silence: float = 0.5,
        backoff: Backoff | None = None,
    ) -> None:
        self._host, self._port, self._frequency = host, port, frequency
        self._fields = tuple(fields)
        self._timeout, self._silence = timeout, silence
        self._backoff = backoff or Backoff()
        self._name = HostName(host)
        self._attempt: _Attempt | None = None
        self._connection: RtdeConnection | None = None
        self._slices: Mapping[str, slice] = {}
        self.health = StreamHealth()
        """Counters and the latest problem."""
        self._counter = LossCounter(1.0 / frequency, self.health)

    @property
    def slices(self) -> Mapping[str, slice]:
        """Field name -> position of its values in a record; empty before the first connection."""
        return self._slices

    def poll(self, timeout: float) -> list[RobotRecord]:
        """Records received, oldest first; waits up to `timeout` seconds for the first.

        Raises:
            RtdeFieldError: The robot does not know a field. Further attempts would not help.
        """
        if self.health.state == "closed":
            return []
        try:
            if self._connection is None and not self._connect(timeout):
                return []
            assert self._connection is not None
            records = self._connection.read(timeout)
        except wire.RtdeFieldError:
            self._fail("")
            raise
        except (SensorError, wire.RtdeProtocolError) as error:
            self._fail(str(error))
            return []
        admit = self._counter.admit
        kept = [record for record in records if admit(record)]
        if kept and self.health.state != "streaming":
            self.health.state = "streaming"
            self.health.connections += 1
            self._backoff.succeeded()
        return kept

    def _connect(self, timeout: float) -> bool:
        if self._attempt is None:
            pause = self._backoff.wait(time.monotonic_ns())
            if pause > 0.0:
                time.sleep(min(pause, timeout))
                return False
            address = self._resolve()
            if address is None:
                time.sleep(min(0.01, timeout))
                return False
            self._attempt = _Attempt(
                partial(
                    RtdeConnection,
                    self._host,
                    self._fields,
                    port=self._port,
                    frequency=self._frequency,
                    timeout=self._timeout,
                    silence=self._silence,
                    address=address,
                )
            )
        self._connection = self._attempt.result(timeout)
        if self._connection is None:
            return False
        self._attempt = None
        self._slices = self._connection.recipe.slices
        return True

    def _resolve(self) -> str | None:
        try:
            return self._name.address()
        except SensorError as error:
            raise SensorError(f"robot at {self._host}:{self._port} cannot be reached: {error}") from None

    def _fail(self, error: str) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None
        self._attempt = None
        self._name.forget()
        self.health.state = "waiting"
        self.health.error = error or self.health.error
        self.health.failures += 1
        self._backoff.failed(time.monotonic_ns())

    def close(self) -> None:
        """Close the connection; later polls return nothing."""
        if self._connection is not None:
            with suppress(OSError):
                self._connection.close()
            self._connection = None
        if self._attempt is not None:
            self._attempt.abandon()
            self._attempt = None
        self.health.state = "closed"


def _reason(error: OSError) -> str:
    if isinstance(error, TimeoutError):
        return "no answer in time"
    return error.strerror or str(error)
