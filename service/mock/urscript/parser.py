"""Parses the subset of URScript that the mock supports in programs from clients.

A program is a `def` (which replaces the running program), a `sec` (which runs in parallel to it) or a single
line. Only calls of `FUNCTIONS` are executed; all other lines are listed in `unknown`. Control structures such
as `while`, `if` and threads are not supported and are listed as well. `errors` says which calls have wrong
arguments; a program with one is not run at all, as one that a controller cannot compile.
"""

import ast
import re
from dataclasses import dataclass
from typing import Any, Literal

from contactsense.service.mock.urscript.functions import FUNCTIONS, check_arguments

_MOTION = frozenset({"stopj", "stopl", "movej", "sleep", "sync"})
"""Statements that a `sec` program must not contain."""
_HEAD = re.compile(r"\s*(def|sec)\s+(\w+)\s*\(\s*\)\s*:\s*(.*)", re.DOTALL)
_OFFSET = re.compile(r"reg_offset_(?:int|float)\s*=\s*(\d+)")
CONTROL_SCRIPT = "rtde_control"
"""Name of the program that ur_rtde's control interface sends."""


@dataclass(frozen=True, slots=True)
class Statement:
    """One call: name, and arguments by parameter."""

    name: str
    arguments: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Program:
    """A parsed program."""

    name: str
    """Name of the program; `line` for a single line."""
    kind: Literal["def", "sec", "line"]
    statements: tuple[Statement, ...]
    """Statements to execute, in order."""
    unknown: tuple[str, ...]
    """Lines that are not supported."""
    errors: tuple[str, ...] = ()
    """Calls with wrong arguments, and what is wrong; such a program is not run."""
    register_offset: int = 0
    """First register that ur_rtde's control script uses."""


class ProgramReader:
    """Splits the bytes from a socket into programs."""

    def __init__(self) -> None:
        self._rest = ""
        self._lines: list[str] = []
        self._depth = 0

    def feed(self, data: bytes) -> list[Program]:
        """Add bytes; returns the programs that are now complete."""
        self._rest += data.decode("utf-8", "replace")
        *lines, self._rest = self._rest.split("\n")
        programs = []
        for line in lines:
            self._lines.append(line)
            word = re.split(r"[\s:(]", line.split("#")[0].strip(), maxsplit=1)[0]
            opens = word in ("def", "sec", "if", "while", "for", "thread")
            closes = len(re.findall(r"(?:^|[\s;:)])end\s*$", line.split("#")[0]))
            self._depth = max(0, self._depth + opens - closes)
            if self._depth == 0:
                text = "\n".join(self._lines)
                self._lines = []
                if text.strip():
                    programs.append(parse(text))
        return programs


def parse(text: str) -> Program:
    """Parse the text of a program."""
    offset = _OFFSET.search(text)
    head = _HEAD.match(text)
    kind: Literal["def", "sec", "line"] = "line"
    name, body = "line", text
    if head is not None:
        kind = "def" if head[1] == "def" else "sec"
        name, body = head[2], re.sub(r"(?:^|(?<=[\s;:)]))end\s*\Z", "", head[3].rstrip())
    register_offset = int(offset[1]) if offset else 0
    if name == CONTROL_SCRIPT:
        return Program(name, kind, (), (), (), register_offset)
    statements, unknown, errors = [], [], []
    for line in body.splitlines():
        source = line.split("#")[0].strip()
        if not source:
            continue
        call = _call(source)
        if call is None or (kind == "sec" and call.name in _MOTION):
            unknown.append(source)
            continue
        try:
            statements.append(Statement(call.name, check_arguments(call.name, call.given, call.named)))
        except ValueError as error:
            errors.append(str(error))
    return Program(name, kind, tuple(statements), tuple(unknown), tuple(errors), register_offset)


@dataclass(frozen=True, slots=True)
class _Call:
    name: str
    given: list[Any]
    named: dict[str, Any]


def _call(source: str) -> _Call | None:
    """Parse the call in a line; None if it is not one of `FUNCTIONS` with constant arguments."""
    try:
        call = ast.parse(source, mode="eval").body
        if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Name):
            return None
        given = [ast.literal_eval(value) for value in call.args]
        named = {str(word.arg): ast.literal_eval(word.value) for word in call.keywords}
    # What Python's parser raises: the last two for deeply nested lines, TypeError for a set of lists.
    except (SyntaxError, ValueError, TypeError, RecursionError, MemoryError):
        return None
    return _Call(call.func.id, given, named) if call.func.id in FUNCTIONS else None
