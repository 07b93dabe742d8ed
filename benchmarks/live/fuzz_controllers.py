"""Fuzzing targets for the parsers of the controller interfaces: any bytes give a value or the parser's own
error.

Each target reads its input as it might arrive from the network, in pieces if it is a stream.
"""

from typing import Any

import msgpack

from contactsense.benchmarks.live.fuzz_target import Target
from contactsense.robots import load
from contactsense.scene import Scene
from contactsense.service.controllers.framing import Unframer, frame
from contactsense.service.controllers.http_calls import HttpError, HttpReader
from contactsense.service.controllers.line_protocol import LineReader
from contactsense.service.controllers.sample_message import MessageError, SampleDecoder, decode, encode
from contactsense.service.controllers.xmlrpc import XmlRpcError, parse_call

_PIECE = 7
_SAMPLE: dict[str, Any] = {
    "t": 0.5, "q": [0.1] * 6, "qd": [0.0] * 6, "joint_torque": [1.0] * 6, "base_wrench": [2.0] * 6,
}  # fmt: skip
_CALL = (
    b"<?xml version='1.0'?><methodCall><methodName>contactsense_expect</methodName><params>"
    b"<param><value><i4>3</i4></value></param><param><value>door</value></param></params></methodCall>"
)


def _pieces(data: bytes) -> list[bytes]:
    return [data[i : i + _PIECE] for i in range(0, len(data), _PIECE)]


def targets() -> list[Target]:
    """All targets."""
    decoder = SampleDecoder(Scene(robot=load("ur5e")))

    def sample(data: bytes, binary: bool) -> object:
        return decoder.sample(decode(data, binary), len(data))

    def frames(data: bytes) -> object:
        unframer = Unframer()
        return [message for piece in _pieces(data) for message in unframer.feed(piece)]

    def requests(data: bytes) -> object:
        reader = HttpReader()
        return [request for piece in _pieces(data) for request in reader.feed(piece)]

    def lines(data: bytes) -> object:
        reader = LineReader()
        return [request for piece in _pieces(data) for request in reader.feed(piece)]

    head = b"POST /RPC2 HTTP/1.1\r\nHost: a\r\nContent-Length: %d\r\n\r\n" % len(_CALL)
    return [
        Target("track JSON", lambda data: sample(data, False), MessageError, (encode(_SAMPLE, False),)),
        Target("track MessagePack", lambda data: sample(data, True), MessageError, (msgpack.packb(_SAMPLE),)),
        Target("track frames", frames, MessageError, (frame(b"{}", False) + frame(b"\x80", True),)),
        Target("XML-RPC HTTP", requests, HttpError, (head + _CALL,)),
        Target("XML-RPC calls", parse_call, XmlRpcError, (_CALL,)),
        Target("line socket", lines, ValueError, (b"status\nexpect 3\ncontactsense_contact\r\n",)),
    ]
