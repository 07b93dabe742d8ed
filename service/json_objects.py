"""JSON that somebody has written: a name that is given twice is refused; Python would take its last value."""

import json
from typing import Any


class RepeatedNameError(ValueError):
    """An object has a name twice."""

    def __init__(self, name: str) -> None:
        super().__init__(f"{name:.40}: expected once, got twice")
        self.name = name[:40]


def parse_json(text: str | bytes) -> Any:
    """The value of a JSON text.

    Raises:
        RepeatedNameError: An object in it has a name twice.
        ValueError: It is no JSON.
    """
    return json.loads(text, object_pairs_hook=_object)


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise RepeatedNameError(name)
        found[name] = value
    return found
