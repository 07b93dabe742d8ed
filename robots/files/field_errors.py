"""Errors of a validation in words: field, expected value, given value."""

import re
import reprlib
from collections.abc import Callable, Iterable, Mapping
from itertools import islice
from typing import Any

from pydantic import BaseModel, ValidationError

from contactsense.robots.files.field_places import Found, Place, find, places_of
from contactsense.robots.files.near_names import did_you_mean, nearest

__all__ = ["Place", "describe", "joined", "reasons"]

_WORDS = {
    "missing": "expected a value, the field is missing",
    "extra_forbidden": "unknown field",
    "invalid_key": "expected names of fields",
    "model_type": "expected fields",
    "model_attributes_type": "expected an object with fields",
    "dict_type": "expected an object with fields",
    "list_type": "expected a list",
    "tuple_type": "expected a list",
    "string_type": "expected text",
    "path_type": "expected a path",
    "bool_type": "expected true or false",
    "bool_parsing": "expected true or false",
    "float_type": "expected a number",
    "float_parsing": "expected a number",
    "int_type": "expected a whole number",
    "int_parsing": "expected a whole number",
    "int_parsing_size": "expected a whole number of fewer digits",
    "int_from_float": "expected a whole number",
    "union_tag_invalid": "expected {discriminator} to be one of {expected_tags}, got {tag!r}",
    "union_tag_not_found": "expected the field {discriminator}",
    "greater_than": "expected a number above {gt:.10g}",
    "greater_than_equal": "expected a number of at least {ge:.10g}",
    "less_than": "expected a number below {lt:.10g}",
    "less_than_equal": "expected a number of at most {le:.10g}",
    "too_short": "expected a length of at least {min_length}, got {actual_length}",
    "too_long": "expected a length of at most {max_length}, got {actual_length}",
    "string_too_short": "expected text that is not empty",
    "string_too_long": "expected at most {max_length} characters",
    "string_pattern_mismatch": "expected text that matches {pattern}",
}
"""Type of one of pydantic's errors -> message, where pydantic's own does not speak of fields."""
_NULLABLE = {"model_type", "model_attributes_type", "dict_type"}
"""Types of errors about a part that an optional field may have: how to write that there is none is told."""
_COMPLETE = {"missing", "value_error", "union_tag_invalid", "union_tag_not_found", "too_short", "too_long"}
"""Types whose messages say what was given, or that nothing was."""
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 60
_SHORT.maxlist = _SHORT.maxtuple = _SHORT.maxdict = 8
_MOST_SHOWN = 120
"""Characters of a value that are shown."""
_MOST_LISTED = 20
"""A message about an unknown field lists the known ones if there are no more."""
_MOST_ISSUES = 100
"""So many errors are put into words; whoever has corrected these sees the next ones."""
_LITERALS = {None: "null", True: "true", False: "false"}


def reasons(issues: Iterable[Mapping[str, Any]], annotation: Any) -> dict[Place, str]:
    """Field -> what was expected and what was given, of the first 100 of pydantic's errors.

    Of a field that may have one of several types, the errors of the type that came closest are given.

    Args:
        issues: The errors.
        annotation: What was validated: a model or another type.
    """
    found: dict[Place, tuple[list[str], str]] = {}
    for issue in islice(issues, _MOST_ISSUES):
        place = find(annotation, issue["loc"]).place
        if issue["type"] == "invalid_key":  # a number, which a place would show as that of a value in a list
            place = place[:-1]
        last = place[-1] if place else None
        if issue["type"] == "missing" and isinstance(last, int):
            # Of a list that is too short, pydantic names every value that is missing.
            found[place[:-1]] = ([f"expected {last + 1} values"], f", got {len(issue['input'])}")
            continue
        got = "" if issue["type"] in _COMPLETE else _given(issue["input"])
        messages, _ = found.setdefault(place, ([], got))
        messages.append(_message(issue, annotation))
    outer = {place[:length] for place in found for length in range(len(place))}
    return {place: _either(messages) + got for place, (messages, got) in found.items() if place not in outer}


def joined(place: Iterable[str | int]) -> str:
    """A path as text, such as `contacts[0].point`."""
    text = ""
    for step in place:
        text += f"[{step}]" if isinstance(step, int) else f".{step}" if text else step
    return text


def describe(
    error: ValidationError,
    model: type[BaseModel],
    spelled: Callable[[Place], str] = joined,
) -> str:
    """All errors in one line: field, expected value, given value.

    Args:
        error: Of the validation.
        model: What was validated.
        spelled: How the user writes a field.
    """
    parts = []
    for place, text in reasons(error.errors(include_url=False), model).items():
        parts.append(f"{spelled(place)}: {text}" if place else text)
    return "; ".join(parts)


def _message(issue: Mapping[str, Any], annotation: Any) -> str:
    words = _WORDS.get(issue["type"])
    if words is None:
        return re.sub("^Input should be ", "expected ", issue["msg"].removeprefix("Value error, "))
    near = ""
    if issue["type"] == "extra_forbidden":
        *location, name = issue["loc"]
        near = _meant(str(name), find(annotation, location), annotation)
    if issue["type"] in _NULLABLE and find(annotation, issue["loc"]).may_be_null:
        near = ", or null for none"
    return words.format(**issue.get("ctx", {})) + near


def _meant(name: str, here: Found, annotation: Any) -> str:
    """End of a message about an unknown field: a part below, or elsewhere, that has a field of this name, as
    its indentation may be wrong, and the field of this part whose name is nearest, or all of them."""
    below = [(*here.place, *place) for kind in here.types for place in places_of(kind, name)]
    own = (*here.place, name)  # of a union, another type may have this field
    meant = [place for place in below or places_of(annotation, name) if place != own]
    if meant and not below:
        meant = [*((*here.place, near) for near in nearest(name, here.fields)), *meant]
    if meant:
        return f" (did you mean {' or '.join(map(_with_level, meant))}?)"
    fields = here.fields
    listed = f" (known: {', '.join(sorted(fields))})" if 0 < len(fields) <= _MOST_LISTED else ""
    return did_you_mean(name, fields) or listed


def _with_level(place: Place) -> str:
    """A place as text; where it is a field of the whole, its name alone would be the unknown one again."""
    return joined(place) + (" at the outermost level" if len(place) == 1 else "")


def _either(messages: list[str]) -> str:
    first, *others = dict.fromkeys(messages)
    return " or ".join((first, *(other.removeprefix("expected ") for other in others)))


def _given(value: Any) -> str:
    """What was given, in words of YAML and JSON, shortened."""
    if value is None or isinstance(value, bool):
        return f", got {_LITERALS[value]}"
    text = _SHORT.repr(value)
    return f", got {text if len(text) <= _MOST_SHOWN else f'{text[:_MOST_SHOWN]}...'}"
