"""JSON that somebody has written: a name that is given twice is refused; Python would take its last value."""

import json
from typing import Any

from contactsense.robots.files.integers import integer

MOST_NAMES = 1000
"""Largest number of names in one object: to explain each unknown one takes time."""


class ObjectError(ValueError):
    """An object has a name twice, or far too many of them."""

    def __init__(self, name: str, reason: str) -> None:
        """Initialize.

        Args:
            name: The name, if it is about one.
            reason: What was expected, and what was given.
        """
        self.name, self.reason = name[:40], reason
        super().__init__(f"{self.name}: {reason}" if name else reason)


def parse_json(text: str | bytes) -> Any:
    """The value of a JSON text.

    Raises:
        ObjectError: An object in it has a name twice, or more than `MOST_NAMES`.
        ValueError: It is no JSON.
    """
    return json.loads(text, object_pairs_hook=_object, parse_int=integer)


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    if len(pairs) > MOST_NAMES:
        raise ObjectError("", f"expected at most {MOST_NAMES} names in an object, got {len(pairs)}")
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise ObjectError(name, "expected once, got twice")
        found[name] = value
    return found
