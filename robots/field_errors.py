"""Errors of a validation in words: field, expected value, given value."""

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from pydantic import BaseModel, ValidationError

from contactsense.robots.near_names import did_you_mean, fields_at

_UNION_BRANCH = re.compile(r"^(constrained-|literal\[|tuple\[|dict\[|float$|str$|function-)")
"""Parts of pydantic's locations that name a branch of a union of types, not a field."""

_WORDS = {
    "missing": "expected a value, the field is missing",
    "extra_forbidden": "unknown field",
    "model_type": "expected fields",
    "model_attributes_type": "expected an object with fields",
    "union_tag_invalid": "expected {discriminator} to be one of {expected_tags}, got {tag!r}",
    "union_tag_not_found": "expected the field {discriminator}",
    "greater_than": "expected a number above {gt:.10g}",
    "greater_than_equal": "expected a number of at least {ge:.10g}",
    "less_than": "expected a number below {lt:.10g}",
    "less_than_equal": "expected a number of at most {le:.10g}",
    "too_short": "expected at least {min_length}, there are {actual_length}",
    "too_long": "expected at most {max_length}, there are {actual_length}",
    "string_too_short": "expected at least {min_length} characters",
    "string_too_long": "expected at most {max_length} characters",
}
"""Type of one of pydantic's errors -> message, where pydantic's own does not speak of fields."""
_COMPLETE = {"missing", "value_error", "union_tag_invalid", "union_tag_not_found", "too_short", "too_long"}
"""Types whose messages say what was given, or that nothing was."""

Place = tuple[str | int, ...]
"""Path to a field: names of fields, keys and indices."""


def reason(issue: Mapping[str, Any], model: type[BaseModel] | None = None) -> str:
    """Message of one of pydantic's errors.

    Args:
        issue: The error.
        model: What was validated; its fields are proposed for unknown ones that are nearly the same.
    """
    words = _WORDS.get(issue["type"])
    if words is not None:
        near = ""
        if issue["type"] == "extra_forbidden" and model is not None:
            *place, name = issue["loc"]
            near = did_you_mean(str(name), fields_at(model, place))
        return words.format(**issue.get("ctx", {})) + near
    message: str = issue["msg"]
    return re.sub("^Input should be ", "expected ", message.removeprefix("Value error, "))


def says_what_was_given(issue: Mapping[str, Any]) -> bool:
    """Whether `reason` already has what was given."""
    return issue["type"] in _COMPLETE


def joined(place: Iterable[str | int]) -> str:
    """A path as text, such as `contacts[0].point`."""
    text = ""
    for step in place:
        text += f"[{step}]" if isinstance(step, int) else f".{step}" if text else step
    return text


def describe(
    error: ValidationError,
    model: type[BaseModel] | None = None,
    spelled: Callable[[Place], str] = joined,
) -> str:
    """All errors in one line: field, expected value, given value.

    Of a field that may have one of several types, the errors of the type that came closest are given.

    Args:
        error: Of the validation.
        model: What was validated; its fields are proposed for unknown ones that are nearly the same.
        spelled: How the user writes a field.
    """
    found: dict[Place, tuple[list[str], str]] = {}
    for item in error.errors(include_url=False):
        place = tuple(step for step in item["loc"] if not _UNION_BRANCH.match(str(step)))
        got = "" if says_what_was_given(item) else f", got {item['input']!r:.200}"
        messages, _ = found.setdefault(place, ([], got))
        messages.append(reason(item, model))
    deepest = {
        place: entry
        for place, entry in found.items()
        if not any(len(other) > len(place) and other[: len(place)] == place for other in found)
    }
    parts = []
    for place, (messages, got) in deepest.items():
        text = " or ".join(dict.fromkeys(messages)) + got
        parts.append(f"{spelled(place)}: {text}" if place else text)
    return "; ".join(parts)
