"""The line socket's protocol: a line `NAME ARGUMENT` in, a line `( 1.0, 2.0 )` out, as URScript's
`socket_read_ascii_float` reads it."""

import math
from collections.abc import Sequence

from contactsense.service.controllers.robot_program import MAX_NUMBERS, Argument

MAX_LINE = 128
"""Longest request [bytes]."""
_LARGEST = 1e12
"""Largest magnitude of a number. A time since 1970 fits [s], and 30 numbers are less than the 1 kB that
URScript reads at a time."""


class LineError(ValueError):
    """A line is not a valid request."""


class LineReader:
    """Parses requests from a stream of bytes: name and arguments of each, or a `LineError` in its place."""

    def __init__(self) -> None:
        self._rest = b""
        self._skipping = False

    def feed(self, chunk: bytes) -> list[tuple[str, list[Argument]] | LineError]:
        """Add bytes; returns the requests that are now complete, one for each line, so that each is answered.
        A line that is too long is reported once, and the rest of it is ignored."""
        requests: list[tuple[str, list[Argument]] | LineError] = []
        *lines, self._rest = (self._rest + chunk).split(b"\n")
        for line in lines:
            if self._skipping:
                self._skipping = False
            else:
                try:
                    requests.append(parse_line(line))
                except LineError as error:
                    requests.append(error)
        if len(self._rest) > MAX_LINE:
            if not self._skipping:
                requests.append(LineError(f"expected at most {MAX_LINE} bytes"))
            self._skipping, self._rest = True, b""
        return requests


def parse_line(line: bytes) -> tuple[str, list[Argument]]:
    """Parse name and arguments of a request; arguments that look like numbers become numbers.

    Raises:
        LineError: The line is too long or is not text.
    """
    if len(line) > MAX_LINE:
        raise LineError(f"expected at most {MAX_LINE} bytes, got {len(line)}")
    try:
        words = line.decode("ascii").split()
    except UnicodeDecodeError:
        raise LineError("expected ASCII text") from None
    if not words or not all(word.isprintable() for word in words):
        raise LineError("expected a name, and an argument where there is one")
    return words[0].removeprefix("contactsense_"), [_argument(word) for word in words[1:]]


def reply(numbers: Sequence[float]) -> bytes:
    """Encode a reply of at most 30 numbers, without exponents; magnitudes are limited to 1e12."""
    cut = [min(max(number, -_LARGEST), _LARGEST) for number in numbers[:MAX_NUMBERS]]
    return f"( {', '.join(f'{number:.6f}' for number in cut)} )\n".encode()


def _argument(word: str) -> Argument:
    try:
        number = float(word)
    except ValueError:
        return word
    return number if math.isfinite(number) else word
