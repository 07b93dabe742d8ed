"""Real-Time Data Exchange of UR controllers, protocol version 2: bytes to messages and back, no sockets.

Client and mock use the same codec. `FrameDecoder` splits the byte stream into frames; `parse_request` parses
messages from a client, `parse_reply` messages from a controller; `encode` writes both kinds. Data packages,
the only frequent ones, bypass the message classes: their payload goes directly to `Recipe.unpack`.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from contactsense.service.wire.recipe import HEADER, Number, Recipe, RtdeFieldError, RtdeProtocolError

__all__ = [
    "DATA",
    "PROTOCOL_VERSION",
    "ControllerVersion",
    "ControllerVersionRequest",
    "Data",
    "Frame",
    "FrameDecoder",
    "InputSetup",
    "Number",
    "OutputSetup",
    "Pause",
    "PauseReply",
    "ProtocolVersionReply",
    "ProtocolVersionRequest",
    "Recipe",
    "RtdeFieldError",
    "RtdeProtocolError",
    "SetupReply",
    "Start",
    "StartReply",
    "TextMessage",
    "encode",
    "parse_reply",
    "parse_request",
]

PROTOCOL_VERSION = 2
DATA = ord("U")

_KNOWN = frozenset(b"VvOISPUM")
_FREQUENCY = struct.Struct(">d")
_VERSION = struct.Struct(">4I")
_MAX_NAMES = 2048
"""Largest size of the field names that the controller accepts [bytes]."""


class Frame(NamedTuple):
    """One received package."""

    kind: int
    """Package type: the character code of V, v, O, I, S, P, U or M."""
    payload: bytes


class FrameDecoder:
    """Splits a byte stream, received in pieces of any size, into frames.

    After invalid bytes the decoder always raises: the beginning of the next frame is unknown, and guessing
    would turn noise into measurements. Close the connection and use a new decoder.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._data_size: int | None = None
        self._error: RtdeProtocolError | None = None

    def expect_data_size(self, size: int) -> None:
        """From now on, treat a data frame of any other size as an error (detected before its body
        arrives)."""
        self._data_size = size

    def feed(self, data: bytes) -> None:
        """Add bytes from the socket."""
        self._buffer += data

    def next_frame(self) -> Frame | None:
        """Return the next complete frame, or None if more bytes are needed.

        Raises:
            RtdeProtocolError: The bytes are not an RTDE frame.
        """
        if self._error is not None:
            raise self._error
        buffer = self._buffer
        if len(buffer) < HEADER.size:
            return None
        size, kind = HEADER.unpack_from(buffer)
        if size < HEADER.size or kind not in _KNOWN or (kind == DATA and self._data_size not in (None, size)):
            self._error = self._complaint(size, kind)
            raise self._error
        if len(buffer) < size:
            return None
        payload = bytes(buffer[HEADER.size : size])
        del buffer[:size]
        return Frame(kind, payload)

    def _complaint(self, size: int, kind: int) -> RtdeProtocolError:
        seen = self._buffer[:16].hex(" ")
        if size < HEADER.size:
            return RtdeProtocolError(f"expected a frame of at least {HEADER.size} bytes, got {size}: {seen}")
        if kind not in _KNOWN:
            return RtdeProtocolError(
                f"expected a package type out of V v O I S P U M, got {kind:#04x}: {seen}"
            )
        return RtdeProtocolError(f"expected data frames of {self._data_size} bytes, got {size}: {seen}")


@dataclass(frozen=True, slots=True)
class ProtocolVersionRequest:
    """Client: requests this protocol version."""

    version: int = PROTOCOL_VERSION


@dataclass(frozen=True, slots=True)
class ProtocolVersionReply:
    """Controller: whether it accepts the version."""

    accepted: bool


@dataclass(frozen=True, slots=True)
class ControllerVersionRequest:
    """Client: requests the version of the controller's software."""


@dataclass(frozen=True, slots=True)
class ControllerVersion:
    """Controller: the version of its software."""

    major: int
    minor: int
    bugfix: int
    build: int


@dataclass(frozen=True, slots=True)
class OutputSetup:
    """Client: requests these fields at this frequency [Hz]."""

    frequency: float
    names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class InputSetup:
    """Client: announces that it will write these fields."""

    names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class SetupReply:
    """Controller: number of the recipe and type of each field; `NOT_FOUND` or `IN_USE` for refused fields."""

    inputs: bool
    recipe_id: int
    types: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Start:
    """Client: requests the start of the data."""


@dataclass(frozen=True, slots=True)
class StartReply:
    """Controller: whether it sends data."""

    accepted: bool


@dataclass(frozen=True, slots=True)
class Pause:
    """Client: requests a pause of the data."""


@dataclass(frozen=True, slots=True)
class PauseReply:
    """Controller: whether it has paused."""

    accepted: bool


@dataclass(frozen=True, slots=True)
class TextMessage:
    """Either side: a text for people; level 0 exception, 1 error, 2 warning, 3 information."""

    message: str
    source: str
    level: int


@dataclass(frozen=True, slots=True)
class Data:
    """Either side: values of a recipe, still packed; `payload` begins with the recipe's number."""

    payload: bytes

    @property
    def recipe_id(self) -> int:
        """Number of the recipe that defines the layout of the values."""
        return self.payload[0]


Request = (
    ProtocolVersionRequest
    | ControllerVersionRequest
    | OutputSetup
    | InputSetup
    | Start
    | Pause
    | TextMessage
    | Data
)
Reply = ProtocolVersionReply | ControllerVersion | SetupReply | StartReply | PauseReply | TextMessage | Data


def encode(message: Request | Reply) -> bytes:
    """Encode a message as a frame.

    Raises:
        RtdeProtocolError: The message does not fit into a frame.
    """
    match message:
        case ProtocolVersionRequest(version):
            return _frame("V", struct.pack(">H", version))
        case ProtocolVersionReply(accepted):
            return _frame("V", bytes([accepted]))
        case ControllerVersionRequest():
            return _frame("v", b"")
        case ControllerVersion(major, minor, bugfix, build):
            return _frame("v", _VERSION.pack(major, minor, bugfix, build))
        case OutputSetup(frequency, names):
            return _frame("O", _FREQUENCY.pack(frequency) + _join(names))
        case InputSetup(names):
            return _frame("I", _join(names))
        case SetupReply(inputs, recipe_id, types):
            return _frame("I" if inputs else "O", bytes([recipe_id]) + ",".join(types).encode("ascii"))
        case Start() | Pause():
            return _frame("S" if isinstance(message, Start) else "P", b"")
        case StartReply(accepted) | PauseReply(accepted):
            return _frame("S" if isinstance(message, StartReply) else "P", bytes([accepted]))
        case TextMessage(text, source, level):
            return _frame("M", _short(text) + _short(source) + bytes([level]))
        case Data(payload):
            return _frame("U", payload)


def parse_request(frame: Frame) -> Request:
    """Parse a message from a client.

    Raises:
        RtdeProtocolError: The payload does not fit its type.
    """
    return _REQUESTS[chr(frame.kind)](frame.payload)


def parse_reply(frame: Frame) -> Reply:
    """Parse a message from a controller.

    Raises:
        RtdeProtocolError: The payload does not fit its type.
    """
    return _REPLIES[chr(frame.kind)](frame.payload)


def _frame(letter: str, payload: bytes) -> bytes:
    size = HEADER.size + len(payload)
    if size > 0xFFFF:
        raise RtdeProtocolError(f"expected a frame of at most {0xFFFF} bytes, got {size}")
    return HEADER.pack(size, ord(letter)) + payload


def _join(names: tuple[str, ...]) -> bytes:
    joined = ",".join(names).encode("ascii")
    if len(joined) > _MAX_NAMES:
        raise RtdeProtocolError(f"expected at most {_MAX_NAMES} bytes of field names, got {len(joined)}")
    return joined


def _split(joined: bytes) -> tuple[str, ...]:
    # ur_rtde ends its list with a comma; blanks after commas occur too.
    names = [name.strip() for name in joined.decode("ascii", "replace").split(",")]
    return tuple(name for name in names if name)


def _short(text: str) -> bytes:
    encoded = text.encode("utf-8")[:255]
    return bytes([len(encoded)]) + encoded


def _exactly(payload: bytes, size: int, what: str) -> bytes:
    if len(payload) != size:
        raise RtdeProtocolError(f"{what}: expected {size} bytes, got {len(payload)}: {payload[:16].hex(' ')}")
    return payload


def _version_request(payload: bytes) -> ProtocolVersionRequest:
    return ProtocolVersionRequest(
        int.from_bytes(_exactly(payload, 2, "request of a protocol version"), "big")
    )


def _controller_version_request(payload: bytes) -> ControllerVersionRequest:
    _exactly(payload, 0, "request of the controller's version")
    return ControllerVersionRequest()


def _controller_version(payload: bytes) -> ControllerVersion:
    return ControllerVersion(*_VERSION.unpack(_exactly(payload, _VERSION.size, "version of the controller")))


def _output_setup(payload: bytes) -> OutputSetup:
    if len(payload) < _FREQUENCY.size:
        raise RtdeProtocolError(f"output setup: expected a frequency of 8 bytes, got {len(payload)}")
    (frequency,) = _FREQUENCY.unpack_from(payload)
    return OutputSetup(frequency, _split(payload[_FREQUENCY.size :]))


def _setup_reply(inputs: bool) -> Callable[[bytes], SetupReply]:
    def parse(payload: bytes) -> SetupReply:
        if not payload:
            raise RtdeProtocolError("reply to a setup: expected a recipe number, got no bytes")
        return SetupReply(inputs, payload[0], _split(payload[1:]))

    return parse


def _start(payload: bytes) -> Start:
    _exactly(payload, 0, "start")
    return Start()


def _pause(payload: bytes) -> Pause:
    _exactly(payload, 0, "pause")
    return Pause()


def _flag(payload: bytes, what: str) -> bool:
    return _exactly(payload, 1, what)[0] != 0


def _text(payload: bytes) -> TextMessage:
    texts = []
    rest = payload
    for what in ("message", "source"):
        if not rest or len(rest) < 1 + rest[0]:
            raise RtdeProtocolError(f"text message: expected a length and a {what}, got {rest[:16].hex(' ')}")
        texts.append(rest[1 : 1 + rest[0]].decode("utf-8", "replace"))
        rest = rest[1 + rest[0] :]
    return TextMessage(texts[0], texts[1], _exactly(rest, 1, "text message: level")[0])


def _data(payload: bytes) -> Data:
    if not payload:
        raise RtdeProtocolError("data package: expected a recipe number, got no bytes")
    return Data(payload)


_REQUESTS: dict[str, Callable[[bytes], Request]] = {
    "V": _version_request,
    "v": _controller_version_request,
    "O": _output_setup,
    "I": lambda payload: InputSetup(_split(payload)),
    "S": _start,
    "P": _pause,
    "M": _text,
    "U": _data,
}
_REPLIES: dict[str, Callable[[bytes], Reply]] = {
    "V": lambda payload: ProtocolVersionReply(_flag(payload, "reply to a protocol version")),
    "v": _controller_version,
    "O": _setup_reply(inputs=False),
    "I": _setup_reply(inputs=True),
    "S": lambda payload: StartReply(_flag(payload, "reply to start")),
    "P": lambda payload: PauseReply(_flag(payload, "reply to pause")),
    "M": _text,
    "U": _data,
}
