"""The subset of XML-RPC for robot programs: bytes in, bytes out. Answers are arrays of doubles, never a
Fault."""

import math
from collections.abc import Sequence
from xml.parsers import expat

from contactsense.service.controllers.robot_program import Argument

MAX_BODY = 65_536
"""Largest request [bytes]."""
MAX_ARGUMENTS = 16
"""Largest number of parameters of a call."""
_MAX_DEPTH = 16
_NUMBERS = ("int", "i4", "i8", "double", "boolean")
_TEXTS = ("string", "value")
_CHILDREN: dict[str, tuple[str, ...]] = {
    "": ("methodCall",),
    "methodCall": ("methodName", "params"),
    "params": ("param",),
    "param": ("value",),
    "value": (*_NUMBERS, "string"),
}


class XmlRpcError(ValueError):
    """The bytes are not a call that can be answered; the text gives the reason."""


class _Call:
    """Processes a document element by element. Unexpected elements are errors."""

    def __init__(self) -> None:
        self.method = ""
        self.arguments: list[Argument] = []
        self._stack: list[str] = [""]
        self._text: list[str] = []
        self._value: Argument | None = None

    def start(self, name: str, attributes: dict[str, str]) -> None:
        if len(self._stack) > _MAX_DEPTH or name not in _CHILDREN.get(self._stack[-1], ()):
            raise XmlRpcError(f"unexpected element <{name:.40}> in <{self._stack[-1]}>")
        if name == "value" and len(self.arguments) >= MAX_ARGUMENTS:
            raise XmlRpcError(f"expected at most {MAX_ARGUMENTS} parameters")
        if name == "methodName" and self.method:
            raise XmlRpcError("expected one methodName")
        self._stack.append(name)
        self._text = []
        if name == "value":
            self._value = None

    def text(self, text: str) -> None:
        self._text.append(text)

    def end(self, name: str) -> None:
        self._stack.pop()
        text = "".join(self._text)
        if name == "methodName":
            self.method = text.strip()
        elif name == "string":
            self._value = text
        elif name in _NUMBERS:
            self._value = _number(text)
        elif name == "value":
            self.arguments.append(text if self._value is None else self._value)
        self._text = []


def parse_call(body: bytes) -> tuple[str, list[Argument]]:
    """Parse name and parameters of a call; parameters are numbers, booleans and strings.

    Raises:
        XmlRpcError: The bytes are not a call, or contain a document type, arrays or structures.
    """
    if len(body) > MAX_BODY:
        raise XmlRpcError(f"expected at most {MAX_BODY} bytes, got {len(body)}")
    call = _Call()
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = call.start
    parser.EndElementHandler = call.end
    parser.CharacterDataHandler = call.text
    parser.StartDoctypeDeclHandler = _no_doctype
    try:
        parser.Parse(body, True)
    except (expat.ExpatError, ValueError, LookupError) as error:  # the latter two: unknown encodings
        raise XmlRpcError(f"no call: {error}") from None
    if not call.method:
        raise XmlRpcError("expected a methodName")
    return call.method, call.arguments


def response(numbers: Sequence[float]) -> bytes:
    """Encode an answer: an array of doubles, which have no exponents in XML-RPC."""
    values = "".join(f"<value><double>{number:.9f}</double></value>" for number in numbers)
    return (
        "<?xml version='1.0'?>\n<methodResponse><params><param><value><array><data>"
        f"{values}</data></array></value></param></params></methodResponse>\n"
    ).encode()


def _no_doctype(*_: object) -> None:
    raise XmlRpcError("expected no document type")


def _number(text: str) -> float:
    try:
        number = float(text)
    except (ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise XmlRpcError(f"expected a number, got {text!r:.40}")
    return number
