"""A second RTDE connection that writes inputs and reads a few outputs, without ever blocking.

It is designed for the pipeline's process: `poll` does what is possible without waiting, `write` sends at once
or not at all. A lost connection and a recipe that another client holds are retried until they succeed.
"""

import errno
import os
import socket
from collections.abc import Mapping, Sequence

from contactsense.service.sensors.clients.host_names import HostName
from contactsense.service.sensors.clients.robot_stream import SensorError
from contactsense.service.wire import rtde as wire

_RETRY = 1.0
"""Time between two attempts to connect, and to get inputs that another client holds [s]."""
_ANSWER = 2.0
"""Longest wait for the connection, and longest silence of the controller afterwards [s]."""
_CHUNK = 1 << 16


class RtdeInputs:
    """Writes to a controller's RTDE inputs.

    Args:
        host: Address or name of the controller. A name is looked up again after each failure.
        port: Its RTDE port.
        recipes: Name of a recipe -> RTDE inputs that are written together.
        outputs: RTDE outputs that are read.
    """

    def __init__(
        self, host: str, port: int, recipes: Mapping[str, Sequence[str]], outputs: Sequence[str] = ()
    ) -> None:
        self._host, self._port = HostName(host), port
        self._recipes = {name: tuple(fields) for name, fields in recipes.items()}
        self._outputs = ("timestamp", *outputs)
        self._frequency = 125.0 if outputs else 10.0
        self._socket: socket.socket | None = None
        self._connected = False
        self._decoder = wire.FrameDecoder()
        self._asked: list[str] = []
        self._granted: dict[str, wire.Recipe] = {}
        self._output: wire.Recipe | None = None
        self._retry_at = 0.0
        self._ask_again_at = float("inf")
        self._heard = 0.0
        self.error = ""
        """The latest problem with the connection; empty while there is none."""
        self.refused: dict[str, str] = {}
        """Name of a recipe that cannot be written -> why."""
        self.values: dict[str, wire.Number] = {}
        """Output field -> its latest value in this connection."""

    @property
    def ready(self) -> bool:
        """Whether all recipes can be written."""
        return all(map(self.can_write, self._recipes)) and self._output is not None and not self.error

    def can_write(self, name: str) -> bool:
        """Whether a recipe can be written, whatever becomes of the others."""
        return name in self._granted and not self.error

    def poll(self, now: float) -> None:
        """Do what is possible without waiting. `now` is the host's monotonic clock [s]."""
        try:
            if self._socket is None:
                if now >= self._retry_at:
                    self._connect(now)
                return
            if not self._connected and not self._is_connected(now):
                return
            self._read(now)
            if now - self._heard > _ANSWER:
                raise OSError("no answer in time")
            if now >= self._ask_again_at:
                self._ask_again_at = float("inf")
                for name in self.refused:
                    self._asked.append(name)
                    self._send(wire.encode(wire.InputSetup(self._recipes[name])))
        except (OSError, SensorError, wire.RtdeProtocolError) as error:
            self._fail(now, str(error.strerror or error) if isinstance(error, OSError) else str(error))

    def write(self, name: str, values: Sequence[wire.Number]) -> bool:
        """Write a recipe's inputs; returns False if that is not possible now."""
        recipe = self._granted.get(name)
        if recipe is None:
            return False
        try:
            self._send(recipe.pack(values))
        except OSError as error:
            self._fail(self._heard, error.strerror or str(error))
            return False
        return True

    def close(self) -> None:
        """Close the connection; the inputs keep their values."""
        if self._socket is not None:
            self._socket.close()
        self._socket, self._connected = None, False
        self._granted, self._output, self._asked = {}, None, []
        self.values.clear()  # what they are after the next connection is not known
        self.refused = {}  # the next connection asks for all recipes

    def _connect(self, now: float) -> None:
        address = self._host.address()
        if address is None:  # it is still being looked up
            return
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._heard = now
        self._decoder = wire.FrameDecoder()
        code = self._socket.connect_ex((address, self._port))
        if code not in (0, errno.EINPROGRESS):
            raise OSError(code, "cannot be reached: " + os.strerror(code))

    def _is_connected(self, now: float) -> bool:
        assert self._socket is not None
        code = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if code:
            raise OSError(code, "cannot be reached: " + os.strerror(code))
        try:
            self._socket.getpeername()
        except OSError:
            if now - self._heard > _ANSWER:
                raise OSError("cannot be reached: no answer in time") from None
            return False
        self._connected, self._heard = True, now
        self._send(wire.encode(wire.ProtocolVersionRequest()))
        for name, fields in self._recipes.items():
            self._asked.append(name)
            self._send(wire.encode(wire.InputSetup(fields)))
        self._send(wire.encode(wire.OutputSetup(self._frequency, self._outputs)))
        return True

    def _send(self, data: bytes) -> None:
        assert self._socket is not None
        try:
            sent = self._socket.send(data)
        except BlockingIOError:
            sent = 0
        if sent != len(data):
            raise OSError("the controller does not read what is written")

    def _read(self, now: float) -> None:
        assert self._socket is not None
        try:
            chunk = self._socket.recv(_CHUNK)
        except BlockingIOError:
            return
        if not chunk:
            raise OSError("the controller closed the connection")
        self._heard = now
        self._decoder.feed(chunk)
        while (frame := self._decoder.next_frame()) is not None:
            if frame.kind == wire.DATA and self._output is not None:
                numbers = self._output.unpack(frame.payload)
                self.values.update(
                    {name: numbers[where.start] for name, where in self._output.slices.items()}
                )
            else:
                self._handle_reply(wire.parse_reply(frame), now)

    def _handle_reply(self, reply: wire.Reply, now: float) -> None:
        match reply:
            case wire.ProtocolVersionReply(accepted):
                if not accepted:
                    raise wire.RtdeProtocolError(f"it does not speak RTDE version {wire.PROTOCOL_VERSION}")
            case wire.SetupReply(True, recipe_id, types):
                if not self._asked:
                    raise wire.RtdeProtocolError("expected one answer to each setup of inputs, got another")
                self._take_inputs(self._asked.pop(0), recipe_id, types, now)
            case wire.SetupReply(False, recipe_id, types):
                self._output = wire.Recipe(recipe_id, self._outputs, types)
                self._send(wire.encode(wire.Start()))
            case wire.StartReply(accepted):
                if not accepted:
                    raise wire.RtdeProtocolError("it refuses to start")
                self.error = ""
            case _:
                pass  # a text message for a person

    def _take_inputs(self, name: str, recipe_id: int, types: tuple[str, ...], now: float) -> None:
        try:
            self._granted[name] = wire.Recipe(recipe_id, self._recipes[name], types)
            self.refused.pop(name, None)
        except wire.RtdeFieldError as error:
            self.refused[name] = _advice(error)
            self._ask_again_at = now + _RETRY

    def _fail(self, now: float, reason: str) -> None:
        self.close()
        self._host.forget()  # the controller may have another address now
        self.error = f"RTDE inputs of the robot at {self._host.host}:{self._port}: {reason}"
        self._retry_at = now + _RETRY


def _advice(error: wire.RtdeFieldError) -> str:
    """Explain what is wrong with a recipe and which other fields to use."""
    parts = []
    if error.in_use:
        parts.append(f"IN_USE: another client writes {', '.join(error.in_use)}")
    if error.not_found:
        parts.append(f"the controller does not know {', '.join(error.not_found)}")
    names = (*error.in_use, *error.not_found)
    if any("speed_slider" in name for name in names):
        parts.append("there is only one speed slider: use registers and let the robot program slow down")
    if any("register" in name for name in names):
        parts.append(
            "take others in the rules' file: int and double 24 to 47 (ur_rtde may use 24 and 42 to 46), bits "
            "64 to 127"
        )
    return "; ".join(parts)
