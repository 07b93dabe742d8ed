"""A scene as a YAML file in which every field is explained, those with their defaults included."""

import re
import textwrap
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from contactsense.scene import Scene
from contactsense.service.scene.fields import PARTS, FieldDescription, describe_fields, yaml_flow

WIDTH = 100
"""Longest line of a comment."""
HEADING = (
    "A scene of contactsense: one arm in its cell. Lengths in m, angles in rad, forces in N, moments in Nm, "
    "masses in kg. A line that begins with # is a comment; a field in a comment has the default shown."
)


def commented_yaml(content: Mapping[str, Any]) -> str:
    """The text of a scene file.

    Args:
        content: The fields that differ from their defaults, as in YAML. Unknown fields raise a ValueError.
    """
    return "\n".join([*_comment(HEADING, ""), "", *_fields(Scene, content, "")]) + "\n"


def _fields(model: type[BaseModel], content: Mapping[str, Any], indent: str) -> list[str]:
    unknown = content.keys() - model.model_fields.keys()
    if unknown:
        raise ValueError(f"{min(unknown)}: unknown field of {model.__name__}")
    lines: list[str] = []
    for field in describe_fields(model):
        given = field.name in content
        if given:
            block = [*_comment(_explanation(field), indent), *_given(model, field, content, indent)]
        else:
            block = _at_default(field, indent)
        # Blank lines set the scene's own fields apart from those that have their defaults.
        lines += ["", *block, ""] if given and not indent else block
    return [line for i, line in enumerate(lines) if line or (i and lines[i - 1])]


def _given(
    model: type[BaseModel], field: FieldDescription, content: Mapping[str, Any], indent: str
) -> list[str]:
    value = content[field.name]
    part = PARTS.get((model, field.name))
    if part is not None and isinstance(value, Mapping):
        return [f"{indent}{field.name}:", *_fields(part, value, indent + "  ")]
    if isinstance(value, list) and value and isinstance(value[0], Mapping):
        return [f"{indent}{field.name}:", *(f"{indent}  - {yaml_flow(item)}" for item in value)]
    return [f"{indent}{field.name}: {yaml_flow(value)}"]


def _at_default(field: FieldDescription, indent: str) -> list[str]:
    explanation = _first_clause(field.meaning) + _unit(field)
    line = f"{indent}# {field.name}: {field.default}  # {explanation}"
    if len(line) <= WIDTH:
        return [line]
    return [*_comment(explanation, indent), f"{indent}# {field.name}: {field.default}"]


def _explanation(field: FieldDescription) -> str:
    return field.meaning.rstrip(".") + _unit(field)


def _first_clause(text: str) -> str:
    """The text up to its first full stop, colon or semicolon that is not part of quoted code."""
    for found in re.finditer(r"[.:;](?: |$)", text):
        if text[: found.start()].count("`") % 2 == 0:
            return text[: found.start()]
    return text


def _unit(field: FieldDescription) -> str:
    return f" [{field.unit}]" if field.unit else ""


def _comment(text: str, indent: str) -> list[str]:
    whole = re.sub(r"\[[^\]]*\]$", lambda unit: unit[0].replace(" ", "\0"), text)  # a unit is not broken
    lines = textwrap.wrap(whole, WIDTH, initial_indent=f"{indent}# ", subsequent_indent=f"{indent}# ")
    return [line.replace("\0", " ") for line in lines]
