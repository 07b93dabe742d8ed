"""Checks of the fields of a scene, and their errors in one line."""

import re
from math import pi, radians

from pydantic import ValidationError

from contactsense.robots.primitives import Vector

_UNION_BRANCH = re.compile(r"^(constrained-|literal\[|tuple\[|dict\[|float$|str$|function-)")
"""Parts of pydantic's locations that name a branch of a union of types, not a field."""


FURTHEST = 5.0
"""Largest coordinate of a sensor's origin or of a tool's centre of mass [m]."""
_WORDS = {
    "missing": "expected a value, the field is missing",
    "extra_forbidden": "unknown field",
    "model_type": "expected fields",
    "model_attributes_type": "expected an object with fields",
}
"""Type of one of pydantic's errors -> message, where pydantic's own does not speak of fields."""


def reason(kind: str, message: str) -> str:
    """Message of one of pydantic's errors, of type `kind`."""
    return _WORDS.get(kind) or message.removeprefix("Value error, ")


def within_one_turn(rpy: Vector) -> Vector:
    """Roll, pitch, yaw [rad] as they are.

    Raises:
        ValueError: an angle is larger than one turn, as angles in degrees are.
    """
    if max(map(abs, rpy)) > 2.0 * pi:
        in_radians = ", ".join(f"{radians(angle):.4g}" for angle in rpy)
        raise ValueError(
            "expected roll, pitch, yaw in rad, none above one turn (6.283), got "
            f"{list(rpy)}; if these are degrees: [{in_radians}]"
        )
    return rpy


def in_metres(place: Vector) -> Vector:
    """A place on the arm [m] as it is.

    Raises:
        ValueError: a coordinate is beyond any arm, as coordinates in mm are.
    """
    if max(map(abs, place)) > FURTHEST:
        raise ValueError(
            f"expected x, y, z in m, none above {FURTHEST:g}, got {list(place)}; "
            f"if these are mm: [{', '.join(f'{1e-3 * x:.4g}' for x in place)}]"
        )
    return place


def describe(error: ValidationError) -> str:
    """All errors in one line: field, expected value, given value.

    Of a field that may have one of several types, the errors of the type that came closest are given.
    """
    found: dict[tuple[str, ...], tuple[list[str], str]] = {}
    for item in error.errors(include_url=False):
        place = tuple(str(key) for key in item["loc"] if not _UNION_BRANCH.match(str(key)))
        got = "" if item["type"] in {"missing", "value_error"} else f", got {item['input']!r}"
        messages, _ = found.setdefault(place, ([], got))
        messages.append(reason(item["type"], item["msg"]))
    deepest = {
        place: entry
        for place, entry in found.items()
        if not any(len(other) > len(place) and other[: len(place)] == place for other in found)
    }
    parts = []
    for place, (messages, got) in deepest.items():
        text = " or ".join(dict.fromkeys(messages)) + got
        parts.append(f"{'.'.join(place)}: {text}" if place else text)
    return "; ".join(parts)
