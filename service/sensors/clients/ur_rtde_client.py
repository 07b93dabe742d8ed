"""Second source of robot samples: the receive interface of ur_rtde.

It may abort the process, hang while it holds the interpreter, or repeat its last values, so it runs in a
supervised child process. It also skips samples: the health counts them.
"""

import importlib.util
import os
import select
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress

from contactsense.service.sensors.clients.robot_stream import (
    Backoff,
    LossCounter,
    RobotRecord,
    SensorError,
    StreamHealth,
)
from contactsense.service.sensors.clients.silence_timer import SilenceTimer
from contactsense.service.sensors.clients.ur_rtde_child import GETTERS, HEAD, STARTED
from contactsense.service.wire.recipe import Recipe
from contactsense.service.wire.rtde_fields import OUTPUTS

_DATAGRAM = 1 << 14
"""Largest message of the child [bytes]."""
_LAST_WORDS = 4096
"""End of the child's error output that is kept [bytes]."""
_START = 30.0
"""Time allowed for the child to start, on a computer that is busy with other things [s]."""
_BATCH = 64
"""Records that are read in one poll at most."""


class UrRtdeStream:
    """Robot records read by ur_rtde in a child process; retries forever, as `RtdeStream` does.

    Args:
        host: Address of the robot; ur_rtde always uses port 30004.
        fields: Requested RTDE fields; ur_rtde must have a getter for each.
        frequency: Packet rate [Hz].
        timeout: Maximum wait for the first record once a new child has started; after that it is killed [s].
        silence: Maximum time without a new record; after that the child is killed [s]. Time in which the host
            stood still does not count.

    Raises:
        SensorError: ur_rtde is not installed, or has no getter for a field.
    """

    def __init__(
        self,
        host: str,
        fields: Sequence[str],
        *,
        frequency: float = 500.0,
        timeout: float = 3.0,
        silence: float = 0.5,
        backoff: Backoff | None = None,
    ) -> None:
        if importlib.util.find_spec("rtde_receive") is None:
            raise SensorError(
                "ur_rtde is not installed: it has wheels for CPython 3.11 and 3.12 on Linux and Windows "
                "(x86-64) only; the default robot client, rtde, needs no extra package"
            )
        wanted = tuple(name for name in fields if name != "timestamp")
        unknown = [name for name in wanted if name not in GETTERS]
        if unknown:
            raise SensorError(
                f"ur_rtde has no getter for {', '.join(unknown)}; expected fields out of {', '.join(GETTERS)}"
            )
        self._host, self._frequency, self._fields = host, frequency, wanted
        self._timeout, self._silence = timeout, silence
        self._backoff = backoff or Backoff()
        names = ("timestamp", *wanted)
        self._slices = Recipe(0, names, [OUTPUTS[name] for name in names]).slices
        count = max(where.stop for where in self._slices.values())
        self._body = struct.Struct(f"={count - 1}d")
        self._child: subprocess.Popen[bytes] | None = None
        self._channel: socket.socket | None = None
        self._stderr = -1
        self._words = b""
        self._timer, self._allowed = SilenceTimer(0), timeout
        self._end: str | None = None
        self.health = StreamHealth()
        """Counters and the latest problem."""
        self._counter = LossCounter(1.0 / frequency, self.health)

    @property
    def slices(self) -> Mapping[str, slice]:
        """Field name -> position of its values in a record."""
        return self._slices

    def poll(self, timeout: float) -> list[RobotRecord]:
        """Records received, oldest first; waits up to `timeout` seconds for the first."""
        if self.health.state == "closed":
            return []
        if self._child is None:
            pause = self._backoff.wait(time.monotonic_ns())
            if pause > 0.0:
                time.sleep(min(pause, timeout))
                return []
        try:
            if self._child is None:
                self._spawn()
            records = self._receive(timeout)
        except SensorError as error:
            self._fail(str(error))
            return []
        if records and self.health.state != "streaming":
            self.health.state = "streaming"
            self.health.connections += 1
            self._backoff.succeeded()
        return records

    def _spawn(self) -> None:
        self._words = b""
        self._end = None
        with ExitStack() as of_the_child:
            try:
                self._channel, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
                of_the_child.enter_context(theirs)
                self._stderr, child_stderr = os.pipe()
                of_the_child.callback(os.close, child_stderr)
                command = [sys.executable, "-m", "contactsense.service.sensors.clients.ur_rtde_child"]
                command += [str(theirs.fileno()), self._host, str(self._frequency), *self._fields]
                self._child = subprocess.Popen(
                    command,
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=child_stderr,
                    pass_fds=(theirs.fileno(),),
                )
            except OSError as error:
                raise SensorError(
                    f"the process of ur_rtde cannot be started: {error.strerror or error}"
                ) from None
        self._channel.setblocking(False)
        os.set_blocking(self._stderr, False)
        self._timer = SilenceTimer(time.monotonic_ns())
        self._allowed = _START

    def _receive(self, timeout: float) -> list[RobotRecord]:
        assert self._channel is not None
        if self._end is not None:
            raise SensorError(self._end_of_process(self._end))
        records: list[RobotRecord] = []
        poller = select.poll()
        poller.register(self._channel, select.POLLIN)
        if poller.poll(timeout * 1e3):
            for _ in range(_BATCH):
                try:
                    datagram = self._channel.recv(_DATAGRAM)
                except BlockingIOError:
                    break
                except ConnectionResetError:
                    datagram = b""
                if datagram == STARTED:
                    self._timer.heard(time.monotonic_ns())
                    self._allowed = self._timeout
                    continue
                if datagram[:1] != b"R":
                    self._end = datagram[1:].decode("utf-8", "replace")
                    if not records:
                        raise SensorError(self._end_of_process(self._end))
                    break
                self._take(datagram, records)
        self._listen()
        now = time.monotonic_ns()
        if records:
            self._timer.heard(now)
            self._allowed = self._silence
        elif self._timer.nothing(now, timeout) > self._allowed:
            raise SensorError(
                f"ur_rtde delivered nothing new from the robot at {self._host}; its process was killed"
            )
        return records

    def _take(self, datagram: bytes, records: list[RobotRecord]) -> None:
        _, arrival, stamp = HEAD.unpack_from(datagram)
        values = self._body.unpack_from(datagram, HEAD.size)
        record = RobotRecord(stamp, arrival, (stamp, *values))
        if self._counter.admit(record):
            records.append(record)

    def _end_of_process(self, reported: str) -> str:
        if reported:
            return f"ur_rtde: {reported} (robot at {self._host})"
        assert self._child is not None
        try:
            status = self._child.wait(1.0)
        except subprocess.TimeoutExpired:
            status = None
        self._listen()
        words = self._words.decode("utf-8", "replace").strip().splitlines()
        last = f": {words[-1].strip()}" if words else ""
        return f"the process of ur_rtde ended with status {status} (robot at {self._host}){last}"

    def _listen(self) -> None:
        # Drained even if the output is not needed: a full pipe would block the child.
        with suppress(BlockingIOError):
            while chunk := os.read(self._stderr, _LAST_WORDS):
                self._words = (self._words + chunk)[-_LAST_WORDS:]

    def _fail(self, error: str) -> None:
        self._bury()
        self.health.state = "waiting"
        self.health.error = error
        self.health.failures += 1
        self._backoff.failed(time.monotonic_ns())

    def _bury(self) -> None:
        if self._child is not None:
            self._child.kill()
            self._child.wait()
            self._child = None
        if self._channel is not None:
            self._channel.close()
            self._channel = None
        if self._stderr >= 0:
            os.close(self._stderr)
            self._stderr = -1

    def close(self) -> None:
        """Terminate the child; later polls return nothing."""
        self._bury()
        self.health.state = "closed"
