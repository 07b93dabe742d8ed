"""Fitted bodies as primitives of a file."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from contactsense.robots.decomposition.yaml_export import body_text, primitive, text, tool_text
from contactsense.robots.files.yaml_fields import fields_in
from contactsense.robots.primitives import Box, Ellipsoid, Sphere
from contactsense.robots.robot import NO_MASS
from contactsense.robots.rotations import rotation_from_rpy
from contactsense.robots.surface.convex_primitives import BOX, ELLIPSOID
from contactsense.robots.yaml_schema import read_surface

UPRIGHT = (0.4, np.pi / 2.0, 0.0), (-1.1, -np.pi / 2.0, 0.7)
"""Orientations with the x axis up or down, where roll and yaw turn about the same axis."""


@pytest.mark.parametrize("kind", [BOX, ELLIPSOID])
@pytest.mark.parametrize("rpy", [(0.3, -0.2, 1.4), *UPRIGHT])
def test_a_body_keeps_its_orientation(kind: int, rpy: tuple[float, float, float]) -> None:
    rotation = rotation_from_rpy(rpy)
    rotation[np.abs(rotation) < 1e-15] = 0.0
    made = primitive(kind, rotation, np.zeros(3), np.array([0.1, 0.2, 0.3, 0.01]))
    assert isinstance(made, Box | Ellipsoid)
    np.testing.assert_allclose(rotation_from_rpy(made.rpy), rotation, atol=2e-4)


BALL = (Sphere(center=(0.0, 0.0, 0.0), radius=0.1),)


@given(st.text(min_size=1))
@example("1")
@example("no")
@example("null")
@example("1e3")
@example("09")
@example("1:30")
@example("2024-13-40")
@example("gripper #2")
@example("a: b")
@example("<<")
@example("two\nlines")
@example("\x85\u2028\U0001f916")
@example("x" * 200 + " " + "x" * 200)
def test_names_are_read_as_they_were(name: str) -> None:
    levels = {"coarse": BALL, "fine": BALL}
    for read in (yaml.safe_load, lambda text: fields_in(text, "file", "robot: ur5e")):
        surface = read(text(name, {name: levels}, [f"Surface of {name}."], 1.0, name))
        assert (surface["robot"], surface["tip"], list(surface["links"])) == (name, name, [name])
        assert read(tool_text(name, NO_MASS, BALL, [], [name]))["tool"]["name"] == name
        assert read(body_text(name, BALL, [], [name]))["bodies"][0]["name"] == name


def test_a_link_whose_name_is_a_number(tmp_path: Path) -> None:
    path = tmp_path / "arm.surface.yaml"
    path.write_text(text("1234", {"1": {"coarse": BALL, "fine": BALL}}, [], 1.0), encoding="utf-8")
    surface = read_surface(path)
    assert (surface.robot, list(surface.links)) == ("1234", ["1"])


def test_plain_names_stand_without_quotes() -> None:
    for name in ("ur5e", "upper_arm", "wrist_3", "2F-85", "my tool", "left/arm.1"):
        assert f"robot: {name}\n" in text(name, {}, [], 1.0)
