"""Fields of a scene of another type than they can have are named, whatever reads them first."""

from pathlib import Path

import pytest

from contactsense import LinkWrenchSensor, Scene, SceneError
from contactsense.robots.primitives import Sphere
from contactsense.robots.surroundings import Body


@pytest.mark.parametrize("field", ["kinematics", "meshes"])
@pytest.mark.parametrize(
    ("text", "given"), [("5", "5"), ("yes", "true"), ("[1]", r"\[1\]"), ("{a: 1}", r"\{")]
)
def test_a_file_that_is_no_path_is_named(tmp_path: Path, field: str, text: str, given: str) -> None:
    """The calibration is read before the fields are checked."""
    (tmp_path / "scene.yaml").write_text(f"robot: ur5e\n{field}: {text}\n")
    with pytest.raises(SceneError, match=rf"scene\.yaml: {field}: expected a path, got {given}"):
        Scene.load(tmp_path / "scene.yaml")


def test_one_part_in_place_of_a_list_is_named() -> None:
    """Python takes a part for a list of its fields, each of which was reported."""
    ball = Sphere(center=(0.0, 0.0, 0.0), radius=0.1)
    with pytest.raises(SceneError, match=r"^bodies: expected a list, got Body\(name='post'[^;]*$"):
        Scene(robot="ur5e", bodies=Body(name="post", primitives=(ball,)))
    with pytest.raises(SceneError, match=r"^link_wrenches: expected a list, got LinkWrenchSensor\([^;]*$"):
        Scene(robot="ur5e", link_wrenches=LinkWrenchSensor(name="elbow", link="forearm"))
