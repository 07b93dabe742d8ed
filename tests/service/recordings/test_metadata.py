"""The scene in a recording's metadata, and in the file that `contactsense calibrate` writes."""

from pathlib import Path

import numpy as np
import pytest

from contactsense import Scene, WrenchSensor
from contactsense.service.cli.calibrate import scene_text
from contactsense.service.recordings import Recording, RecordingError, read
from contactsense.service.recordings.export import export
from contactsense.service.recordings.metadata import metadata, scene_of_meta

LINES = ("0 0 0 100 0.30 4", "4 50 0 100 1.20 22")
CELL = """
robot: ur5e
mounting: wall
tool:
  name: Greifer Ü
  mass: 1.0
  primitives:
    - {kind: sphere, center: [0, 0, 0], radius: 0.1}
    - {kind: capsule, a: [0, 0, 0], b: [0, 0, 0.1], radius: 0.03}
    - {kind: cylinder, a: [0, 0, 0], b: [0, 0, 0.1], radius_a: 0.04, radius_b: 0.03, rounding: 0.004}
    - {kind: ellipsoid, center: [0, 0, 0.1], radii: [0.02, 0.03, 0.04]}
    - {kind: box, center: [0, 0, 0.1], half: [0.05, 0.02, 0.02], rounding: 0.004}
  deviation: |
    0 0 0 100 0.30 4
    4 50 0 100 1.20 22
bodies:
  - {name: post, primitives: [{kind: sphere, center: [0.5, 0, 0], radius: 0.1}]}
wrist_wrench: {force_noise: 0.5}
link_wrenches: [{name: elbow, link: forearm}]
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "cell.yaml").write_text(CELL, encoding="utf-8")
    return tmp_path / "cell.yaml"


def test_a_recording_carries_every_field_of_its_scene(file: Path) -> None:
    scene = Scene.load(file)
    assert scene_of_meta(metadata(scene), "a file").model_dump() == scene.model_dump()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("robot: ur5e\nrobot: ur10e", "robot: expected once, got in line 1 and in line 2"),
        ("robot: !!bool ur5e", "not YAML: expected a value of the type bool, got 'ur5e'"),
        ("gravity: " + 5000 * "[" + 5000 * "]", "nested too deeply"),
        ("ur5e", "expected fields such as `robot: ur5e`, got 'ur5e'"),
        ("robot: ur5e\ngravity: 99", "gravity: expected a number of at most 30, got 99"),
    ],
    ids=["twice", "tag", "nested", "text", "number"],
)
def test_a_scene_that_cannot_be_used_is_told_with_the_recording(text: str, told: str) -> None:
    with pytest.raises(RecordingError, match=r"^a file: its scene cannot be used: ") as refused:
        scene_of_meta({"contactsense.scene": text}, "a file")
    assert told in str(refused.value)


def test_names_that_look_like_numbers_are_kept(file: Path) -> None:
    file.write_text(CELL.replace("Greifer Ü", "'09'").replace("name: post", "name: '1e3'"), encoding="utf-8")
    scene = Scene.load(file)
    assert (scene.tool and scene.tool.name, scene.bodies[0].name) == ("09", "1e3")
    assert scene_of_meta(metadata(scene), "a file").model_dump() == scene.model_dump()
    file.write_text(scene_text(file, scene, file), encoding="utf-8")
    assert Scene.load(file).model_dump() == scene.model_dump()


def test_a_calibrated_scene_keeps_the_surface_of_its_tool(file: Path) -> None:
    scene = Scene.load(file)
    file.write_text(scene_text(file, scene, file), encoding="utf-8")
    assert Scene.load(file).model_dump() == scene.model_dump()
    assert "  name: Greifer Ü\n" in file.read_text(encoding="utf-8")
    assert f"  deviation: |\n    {LINES[0]}\n    {LINES[1]}\n" in file.read_text(encoding="utf-8")


def test_a_calibrated_scene_keeps_the_numbers_of_the_file(file: Path) -> None:
    file.write_text(CELL + "gravity: 010\ntorsion: 1e-3\n", encoding="utf-8")
    scene = Scene.load(file)
    file.write_text(scene_text(file, scene, file), encoding="utf-8")
    assert (scene.gravity, scene.torsion) == (10.0, 1e-3)
    assert Scene.load(file).model_dump() == scene.model_dump()


def test_a_folder_of_recordings_with_different_scenes_has_none_of_its_own(tmp_path: Path) -> None:
    """The files of one would be read by the scene of the other."""
    truth = np.tile([0.0, 0.0, -200.0, 0.0, 0.0, 0.0], (20, 1))
    scenes = {
        "samples-a": Scene(robot="ur5e"),
        "samples-b": Scene(robot="ur5e", base_wrench=WrenchSensor(bias=(0, 0, 100, 0, 0, 0))),
    }
    for k, (name, scene) in enumerate(scenes.items()):
        t, still = k + 0.002 * np.arange(20.0), np.zeros((20, 6))
        made = Recording(name, t, still, still, still, truth, None, np.arange(20))
        export(made, tmp_path / f"{name}.parquet", scene=scene)
    with pytest.raises(
        RecordingError, match=r"samples-a\.parquet and samples-b\.parquet carry different scenes"
    ):
        read(tmp_path)
    for name in scenes:
        np.testing.assert_allclose(read(tmp_path / f"{name}.parquet").base_wrench, truth)
    # Who names a scene means it for all.
    assert len(read(tmp_path, scenes["samples-a"])) == 40
