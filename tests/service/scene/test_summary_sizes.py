"""Sizes of tools and bodies in what is said of a scene, and lengths in millimetres."""

import pytest

from contactsense.robots.primitives import Box, Capsule, Sphere
from contactsense.robots.surface.primitive_extent import extent
from contactsense.robots.surroundings import Body
from contactsense.robots.tool import Tool
from contactsense.scene import Scene
from contactsense.service.drawing.posture import usual_posture
from contactsense.service.scene.summary import scene_warnings, summarize

PALM = Box(center=(0.0, 0.0, 0.05), half=(0.04, 0.03, 0.05), rounding=0.005)


def test_the_summary_says_number_and_size() -> None:
    finger = Capsule(a=(0.0, 0.0, 0.1), b=(0.0, 0.0, 0.2), radius=0.01)
    table = Body(name="table", primitives=(Box(center=(0.0, 0.0, 0.0), half=(1.0, 0.5, 0.1), rounding=0.01),))
    assert extent((PALM, finger)) == pytest.approx([0.08, 0.06, 0.21])
    for shapes, text in (
        ((PALM,), "1 primitive, 0.08 x 0.06 x 0.1 m"),
        ((PALM, finger), "2 primitives, 0.08 x 0.06 x 0.21 m"),
    ):
        scene = Scene(robot="ur5e", tool=Tool(primitives=shapes), bodies=(table,))
        lines = {line.subject: line.text for line in summarize(scene, usual_posture(scene.robot))}
        assert text in lines["tool"]
        assert lines["bodies"] == "table (obstacle), 1 primitive, 2 x 1 x 0.2 m along its axes"


def test_lengths_in_millimetres_are_noticed() -> None:
    """Those that may yet be those of a hall are no errors; see `tests/contactsense/test_scene.py`."""
    far = Sphere(center=(0.0, 0.0, 40.0), radius=0.05)
    large = Box(center=(0.0, 0.0, 0.0), half=(50.0, 30.0, 2.0), rounding=1.0)
    scene = Scene(robot="ur5e", bodies=(Body(name="post", primitives=(large, PALM, far)),))
    first, second = scene_warnings(scene)
    assert first.startswith("bodies[0].primitives[0]: expected at most 5 m")
    assert "a size of 100 m; are these mm?" in first
    assert second.startswith("bodies[0].primitives[2]: expected at most 5 m")
    assert "a distance of 39.95 m" in second


def test_a_tool_in_metres_gives_no_warning() -> None:
    assert scene_warnings(Scene(robot="ur5e", tool=Tool(mass=1.0, primitives=(PALM,)))) == ()
