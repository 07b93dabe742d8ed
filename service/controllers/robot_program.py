"""Methods for robot programs: each returns a flat list of floats, the status first. The same over XML-RPC and
the line socket. Methods and the meaning of each number do not change; more may be added."""

import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from typing import Any

from contactsense.service.live.hub import Hub
from contactsense.service.reactions.state import Reactions

NONE, CONTACT, AMBIGUOUS, DEGRADED, NO_ESTIMATE, MULTIPLE = 0.0, 1.0, 2.0, 3.0, 4.0, 5.0
"""Status codes: contact state according to the latest estimate."""
UNKNOWN_METHOD, BAD_ARGUMENT, NOT_POSSIBLE, BAD_REQUEST = -1.0, -2.0, -3.0, -4.0
"""Status codes: why a request was not executed."""
INTERFACE = 1.0
"""Version of this interface; higher versions only add to it."""
MAX_NUMBERS = 30
"""Largest number of values that URScript's `socket_read_ascii_float` reads."""

Argument = float | str
_STATUS = {
    "none": NONE,
    "contact": CONTACT,
    "ambiguous": AMBIGUOUS,
    "degraded": DEGRADED,
    "multiple": MULTIPLE,
}
_STALE = 0.1
"""An estimate older than this counts as absent [s]."""


class NewestEstimate:
    """The latest estimate of the pipeline, parsed only on request.

    Args:
        hub: Stores the latest message.
        current: Returns whether estimates are current.
    """

    def __init__(self, hub: Hub, current: Callable[[], bool]) -> None:
        self._hub, self._current = hub, current
        self._read: bytes | None = None
        self._estimate: dict[str, Any] = {}

    @property
    def age(self) -> float:
        """Time since the estimate arrived [s]; infinite if there is none."""
        return time.monotonic() - self._hub.last_arrival

    def read(self) -> Mapping[str, Any] | None:
        """Return the estimate in the form of `EstimateOut`; None if none is current."""
        last = self._hub.last
        if last is None or self.age > _STALE or not self._current():
            return None
        if last is not self._read:
            self._read, self._estimate = last, json.loads(last)
        return self._estimate


class RobotProgramMethods:
    """The methods, by name. None of them waits or raises.

    Args:
        newest: The latest estimate.
        reactions: Receives announcements and acknowledgements.
    """

    def __init__(self, newest: NewestEstimate, reactions: Reactions) -> None:
        self._newest, self._reactions = newest, reactions
        self._methods: dict[str, tuple[Callable[..., list[float]], int]] = {
            "version": (self._version, 0),
            "status": (self._status, 0),
            "contact": (self._contact, 0),
            "link": (self._link, 0),
            "wrench": (self._wrench, 0),
            "expect": (self._expect, 1),
            "acknowledge": (self._acknowledge, 0),
        }

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all methods, without the prefix that they have over XML-RPC."""
        return tuple(self._methods)

    def call(self, name: str, arguments: Sequence[Argument]) -> list[float]:
        """Call a method; returns at most 30 finite numbers, the status first."""
        method, expected = self._methods.get(name, (None, 0))
        if method is None:
            return [UNKNOWN_METHOD]
        if len(arguments) != expected:
            return [BAD_ARGUMENT]
        return [_number(value) for value in method(*arguments)]

    def _version(self) -> list[float]:
        numbers = [int(part) for part in version("contactsense").split(".")[:3] if part.isdigit()]
        return [self._code(), INTERFACE, *[*numbers, 0, 0, 0][:3]]

    def _code(self) -> float:
        estimate = self._newest.read()
        return NO_ESTIMATE if estimate is None else _STATUS[estimate["status"]]

    def _status(self) -> list[float]:
        estimate = self._newest.read() or {"contacts": [], "t": 0.0}
        contacts = len({contact["id"] for contact in estimate["contacts"]})
        age = self._newest.age
        return [
            self._code(),
            contacts,
            len(self._reactions.latches),
            -1.0 if math.isinf(age) else age,
            estimate["t"],
        ]

    def _best(self) -> Mapping[str, Any] | None:
        estimate = self._newest.read()
        return estimate["contacts"][0] if estimate and estimate["contacts"] else None

    def _contact(self) -> list[float]:
        best = self._best()
        if best is None:
            return [self._code(), 0.0, -1.0, *[0.0] * 12]
        force = best["force_base"]
        return [
            self._code(),
            best["id"],
            best["link_index"],
            best["probability"],
            *best["point_base"],
            *force,
            math.hypot(*force),
            *best["normal_base"],
            best["torsion"],
        ]

    def _link(self) -> list[float]:
        best, estimate = self._best(), self._newest.read()
        if best is None or estimate is None:
            return [self._code(), -1.0, 0.0, 0.0, 0.0, 0.0]
        probabilities, index = estimate["link_probability"], best["link_index"]
        known = probabilities[index] if index < len(probabilities) else best["probability"]
        return [self._code(), index, known, *best["point"]]

    def _wrench(self) -> list[float]:
        estimate = self._newest.read()
        return [self._code(), *([0.0] * 6 if estimate is None else estimate["wrench"])]

    def _expect(self, value: Argument) -> list[float]:
        rules = self._reactions.rules
        if value == 0:
            return self._outcome(rules is not None and self._reactions.withdraw())
        windows = () if rules is None else rules.expected
        name = next((window.name for window in windows if value in (window.value, window.name)), None)
        if rules is not None and name is None:
            return [BAD_ARGUMENT]
        return self._outcome(name is not None and self._reactions.announce(name))

    def _acknowledge(self) -> list[float]:
        rules = self._reactions.rules
        return self._outcome(rules is not None and self._reactions.acknowledge(None, "the robot program"))

    def _outcome(self, done: bool) -> list[float]:
        return [self._code() if done else NOT_POSSIBLE]


def _number(value: Any) -> float:
    """Convert a value to a float; unknown values become 0, because URScript has no NaN."""
    return float(value) if value is not None and math.isfinite(value) else 0.0
