"""The fields of a scene: name, unit, default and meaning, from the models that check them."""

import re
from collections.abc import Mapping
from typing import Any, Literal, NamedTuple, get_args, get_origin

import yaml
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from contactsense.robots.files.yaml_fields import Dumper
from contactsense.robots.surroundings import Body
from contactsense.robots.tool import Tool
from contactsense.scene import Scene
from contactsense.sensors.settings import (
    Friction,
    JointTorqueSensor,
    LinkInertia,
    LinkWrenchSensor,
    WrenchSensor,
)

PARTS: Mapping[tuple[type[BaseModel], str], type[BaseModel]] = {
    (Scene, "tool"): Tool,
    (Scene, "base_wrench"): WrenchSensor,
    (Scene, "wrist_wrench"): WrenchSensor,
    (Scene, "joint_torque"): JointTorqueSensor,
    (JointTorqueSensor, "friction"): Friction,
}
"""Model and field -> model of the fields below it."""
TABLES: Mapping[str, type[BaseModel]] = {
    "The scene": Scene,
    "`base_wrench`, `wrist_wrench`": WrenchSensor,
    "`link_wrenches`, each": LinkWrenchSensor,
    "`joint_torque`": JointTorqueSensor,
    "`joint_torque.friction`": Friction,
    "`tool`": Tool,
    "`bodies`, each": Body,
    "`inertia`, for each link by name": LinkInertia,
}
"""Heading -> model, in the order of docs/scene.md."""
_UNIT = re.compile(r"\s*\[([^\[\]]+)\]")


class FieldDescription(NamedTuple):
    """What there is to know of one field."""

    name: str
    unit: str
    """Empty where there is none."""
    default: str
    """As in YAML; `required` where there is none."""
    meaning: str
    """In whole sentences, without the unit."""


def describe_fields(model: type[BaseModel]) -> tuple[FieldDescription, ...]:
    """All fields of a model, in its order."""
    return tuple(_describe(name, info) for name, info in model.model_fields.items())


def yaml_flow(value: Any) -> str:
    """A value as YAML in one line."""
    return str(
        yaml.dump(
            [value],
            Dumper=Dumper,
            default_flow_style=True,
            width=1_000_000,
            sort_keys=False,
            allow_unicode=True,
        )
    )[1:-2]


def _describe(name: str, info: FieldInfo) -> FieldDescription:
    text = " ".join((info.description or "").split())
    units = ", ".join(dict.fromkeys(_UNIT.findall(text)))
    meaning = re.sub(r"\bNone\b", "`null`", _UNIT.sub("", text))
    choices = _choices(info.annotation)
    if any(f"`{choice}`" not in meaning for choice in choices):
        meaning += f" One of {', '.join(f'`{choice}`' for choice in choices)}."
    return FieldDescription(info.alias or name, units, _default(info), meaning)


def _choices(annotation: Any) -> tuple[str, ...]:
    """The words that a field may have, if it is one of several."""
    if get_origin(annotation) is Literal:
        return get_args(annotation)
    return tuple(choice for part in get_args(annotation) for choice in _choices(part))


def _default(info: FieldInfo) -> str:
    if info.is_required():
        return "required"
    default = info.get_default(call_default_factory=True)
    if isinstance(default, BaseModel):
        default = default.model_dump(mode="json", exclude_defaults=True)
    return yaml_flow(list(default) if isinstance(default, tuple) else default)
