"""Truth values where a file must have numbers."""

from collections.abc import Callable
from typing import Any

import pytest
import yaml

from contactsense.robots.yaml_schema import JointEntry
from contactsense.scene import Scene
from contactsense.service.mock.arm.script import Script
from contactsense.service.reactions.rules import ReactionRules


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
    with pytest.raises(ValueError, match="Input should be a valid number"):
        model(**yaml.safe_load(text))


def test_a_copy_has_no_other_fields() -> None:
    scene = Scene(robot="ur5e")
    assert scene.model_copy(update={"gravity": 3.7}).gravity == 3.7
    with pytest.raises(ValueError, match=r"gravty: unknown field \(did you mean gravity\?\)"):
        scene.model_copy(update={"gravty": 3.7})
