"""Wrong fields of objects made in Python, and truth values where a file must have numbers."""

import pickle
from collections.abc import Callable
from typing import Any

import pytest
import yaml

from contactsense.robots.files.file_model import FieldError, FileModel
from contactsense.robots.primitives import Sphere
from contactsense.robots.surroundings import Body
from contactsense.robots.tool import Tool
from contactsense.robots.yaml_schema import JointEntry
from contactsense.scene import JointTorqueSensor, LinkWrenchSensor, Scene, SceneError, WrenchSensor
from contactsense.sensors.settings import Friction
from contactsense.service.mock.arm.script import Script
from contactsense.service.reactions.rules import ReactionRules


@pytest.mark.parametrize(
    ("model", "fields", "told"),
    [
        (WrenchSensor, {"force_noise": -1}, "force_noise: expected a number of at least 1e-09, got -1"),
        (
            LinkWrenchSensor,
            {"name": "elbow"},
            "link: expected a value, the field is missing",
        ),
        (
            JointTorqueSensor,
            {"noise": "x", "friction": {"coulomb": [1, -2]}},
            "noise: expected a number or a list, got 'x'; "
            "friction.coulomb[1]: expected a number of at least 0, got -2",
        ),
        (Friction, {"velocity": 0}, "velocity: expected a number above 0, got 0"),
        (Tool, {"mas": 1}, "mas: unknown field (did you mean mass?), got 1"),
        (Body, {"name": "a", "primitives": 3}, "primitives: expected a list, got 3"),
        (Sphere, {"center": (0, 0), "radius": 1}, "center: expected 3 values, got 2"),
    ],
)
def test_what_is_wrong_with_an_object_made_in_python_is_one_line(
    model: type[FileModel], fields: dict[str, Any], told: str
) -> None:
    """It was pydantic's error of many lines, with an address on the internet."""
    with pytest.raises(FieldError) as caught:
        model(**fields)
    assert str(caught.value) == told
    assert caught.value.model == model.__name__


def test_the_error_of_an_object_is_the_same_in_another_process() -> None:
    """It could be sent, but not received, which left a pool of processes waiting for ever."""
    with pytest.raises(FieldError) as caught:
        Body(name="a", primitives=lambda: 3)
    received = pickle.loads(pickle.dumps(caught.value))
    assert str(received) == str(caught.value)
    assert (received.model, received.reasons) == ("Body", caught.value.reasons)
    with pytest.raises(SceneError) as whole:
        Scene(robot="ur5e", contacts=0)
    assert pickle.loads(pickle.dumps(whole.value)).reasons == {
        ("contacts",): "expected a number of at least 1, got 0"
    }


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("base_wrench: {force_noise: yes}", "base_wrench.force_noise: expected a number, got true"),
        ("joint_torque: {noise: [1, 1, off, 1, 1, 1]}", r"noise\[2\]: expected a number, got false"),
        ("gravity: on", "gravity: expected a number, got true"),
        ("link_prior: {base: 1.0, shoulder: yes}", "shoulder: expected a number, got true"),
        ("contacts: true", "contacts: expected a whole number, got true"),
        ("tool: {mass: true}", "tool.mass: expected a number, got true"),
        (
            "tool: {mass: 1, primitives: [{kind: sphere, center: [0, 0, no], radius: 0.1}]}",
            r"center\[2\]: expected a number, got false",
        ),
    ],
)
def test_truth_is_no_number_in_a_scene(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Scene(robot="ur5e", **yaml.safe_load(text))


def test_truth_is_meant_where_it_can_be() -> None:
    assert Scene(robot="ur5e", **yaml.safe_load("{picks_up: yes, base_wrench: {}}")).picks_up


@pytest.mark.parametrize(
    ("model", "text"),
    [
        (Script, "{robot: ur5e, noise: {base_force: yes}, trajectory: {start: [0, 0, 0, 0, 0, 0]}}"),
        (ReactionRules, "{moving_speed: yes, rules: [{name: any, levels: [{force: 10}]}]}"),
        (JointEntry, "{name: elbow, xyz: [0, 0, 1], rpy: [0, 0, yes]}"),
    ],
)
def test_truth_is_no_number_in_other_files(model: Callable[..., Any], text: str) -> None:
    with pytest.raises(ValueError, match=r"(base_force|moving_speed|rpy\[2\]): expected a number, got true"):
        model(**yaml.safe_load(text))


def test_a_copy_has_no_other_fields() -> None:
    scene = Scene(robot="ur5e")
    assert scene.model_copy(update={"gravity": 3.7}).gravity == 3.7
    with pytest.raises(ValueError, match=r"gravty: unknown field \(did you mean gravity\?\)"):
        scene.model_copy(update={"gravty": 3.7})
