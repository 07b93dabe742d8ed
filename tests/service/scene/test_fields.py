"""What is said of every field, and scene files written with it."""

import pytest
import yaml
from pydantic import BaseModel

from contactsense.scene import Scene
from contactsense.sensors.settings import WrenchSensor
from contactsense.service.scene.commented_yaml import WIDTH, commented_yaml
from contactsense.service.scene.example import EXAMPLE
from contactsense.service.scene.fields import PARTS, TABLES, describe_fields


@pytest.mark.parametrize("model", TABLES.values(), ids=lambda model: model.__name__)
def test_every_field_has_a_meaning(model: type[BaseModel]) -> None:
    for field in describe_fields(model):
        assert field.meaning.endswith("."), field.name
        assert "[" not in field.meaning, field.name


def test_units_defaults_and_choices() -> None:
    fields = {field.name: field for field in describe_fields(WrenchSensor)}
    assert (fields["rpy"].unit, fields["rpy"].default) == ("rad", "[0.0, 0.0, 0.0]")
    assert (fields["bias"].unit, fields["range"].default) == ("N, Nm", "null")
    assert fields["sign"].meaning.endswith("One of `arm_on_sensor`, `sensor_on_arm`.")
    assert describe_fields(Scene)[0].default == "required"


def test_the_example_keeps_its_fields_and_loads() -> None:
    content = yaml.safe_load(commented_yaml(EXAMPLE))
    assert content == EXAMPLE
    assert Scene(**content).link_names[-1] == "gripper"


def test_fields_in_comments_are_the_defaults() -> None:
    """Uncommented, the file says the same: so its comments are no less true than its fields."""
    content = {"robot": "ur5e", "base_wrench": {"sign": "sensor_on_arm"}}
    lines = commented_yaml(content).splitlines()
    names = {name for model in (Scene, *PARTS.values()) for name in model.model_fields}
    bare = [line.lstrip(" #") if line.lstrip(" #").split(":")[0] in names else line for line in lines]
    indented = [
        f"{line[: len(line) - len(line.lstrip(' '))]}{new}" if line.lstrip().startswith("#") else line
        for line, new in zip(lines, bare, strict=True)
    ]
    full = yaml.safe_load("\n".join(indented).replace("joint_torque: {}", "joint_torque: {noise: 1.0}"))
    assert full.keys() == Scene.model_fields.keys()
    assert Scene(**full).model_dump() == Scene(**content).model_dump()


def test_lines_are_short_and_null_stays_null() -> None:
    text = commented_yaml({"robot": "ur5e", "joint_torque": None})
    assert max(map(len, text.splitlines())) <= WIDTH
    assert yaml.safe_load(text) == {"robot": "ur5e", "joint_torque": None}


def test_a_field_that_no_scene_has_is_refused() -> None:
    with pytest.raises(ValueError, match="frictoin: unknown field of Scene"):
        commented_yaml({"robot": "ur5e", "frictoin": 1.0})
