"""The page docs/reaction_fields.md: `python -m contactsense.service.reactions.page > docs/reaction_fields.md`
writes it again."""

from collections.abc import Iterable, Mapping
from typing import Any, get_args

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from contactsense.service.reactions.actions import Action
from contactsense.service.reactions.rules import (
    Direction,
    ExpectedContact,
    Inputs,
    Level,
    ReactionRules,
    RobotAddress,
    Rule,
)
from contactsense.service.scene.fields import describe_fields

_BEGINNING = (
    "# The rules file",
    "All fields of a rules file, `reactions.yaml`, with units, defaults and ranges: for those who write "
    "rules. [reactions.md](reactions.md) has a complete file and says what rules and actions do.",
    "This page is made from the code: `python -m contactsense.service.reactions.page > "
    "docs/reaction_fields.md`.",
    "Fields without default are required. Unknown fields are refused. `null` means none. Registers are given "
    "by number, such as `46`, or by the name of the RTDE field, such as `input_int_register_46`.",
)
"""Paragraphs before the tables."""
TABLES: Mapping[str, type[BaseModel]] = {
    "The file": ReactionRules,
    "`robot`": RobotAddress,
    "`rules`, each": Rule,
    "`contact`, `collision`": Level,
    "`direction`": Direction,
    "`inputs`": Inputs,
    "`expected`, each": ExpectedContact,
}
"""Heading -> model of all that is no action."""
_BOUNDS = {"gt": "above", "ge": "at least", "lt": "below", "le": "at most"}


def action_tables() -> dict[str, type[BaseModel]]:
    """Heading -> model of each kind of action."""
    union = get_args(Action)[0]
    return {f"`type: {get_args(m.model_fields['type'].annotation)[0]}`": m for m in get_args(union)}


def reaction_page() -> str:
    """The text of docs/reaction_fields.md."""
    parts = [part for heading, model in TABLES.items() for part in (f"## {heading}", _table(model))]
    parts.append("## `actions`, each by name")
    parts += [part for head, model in action_tables().items() for part in (f"### {head}", _table(model))]
    return "\n\n".join((*_BEGINNING, *parts)) + "\n"


def _table(model: type[BaseModel]) -> str:
    rows = ["| field | unit | default | range | meaning |", "| --- | --- | --- | --- | --- |"]
    for field, info in zip(describe_fields(model), model.model_fields.values(), strict=True):
        if field.name != "type":
            meaning = field.meaning.replace("|", "\\|")
            cells = (f"`{field.name}`", field.unit, _default(field.default, info), _range(info), meaning)
            rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows)


def _default(text: str, info: FieldInfo) -> str:
    if text == "required":
        return text
    if isinstance(info.annotation, type) and issubclass(info.annotation, BaseModel):
        return "the defaults below"
    return "none" if text in ("{}", "[]") else f"`{text}`"


def _range(info: FieldInfo) -> str:
    """Bounds of a number, or of each of several numbers."""
    found = dict(_bounds(info.annotation, info.metadata))
    if set(found) == {"ge", "le"}:
        return f"{found['ge']:.10g} to {found['le']:.10g}"
    return ", ".join(f"{_BOUNDS[kind]} {value:.10g}" for kind, value in found.items())


def _bounds(annotation: Any, metadata: Iterable[object]) -> list[tuple[str, float]]:
    """Kind and value of each bound in a type such as `Annotated[int, Field(ge=0)] | None`."""
    found = [(kind, entry) for entry in metadata for kind in _BOUNDS if hasattr(entry, kind)]
    bounds = [(kind, float(getattr(entry, kind))) for kind, entry in found]
    for part in get_args(annotation):
        inner = (part.annotation, part.metadata) if isinstance(part, FieldInfo) else (part, ())
        bounds += _bounds(*inner)
    return bounds


if __name__ == "__main__":
    print(reaction_page(), end="")
