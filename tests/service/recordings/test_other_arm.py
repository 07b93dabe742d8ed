"""Recordings whose scene names files of an arm that have changed since."""

import re
from pathlib import Path

import numpy as np
import pytest

from contactsense import Scene
from contactsense.service.recordings import Recording, RecordingError, read
from contactsense.service.recordings.export import export
from contactsense.service.recordings.metadata import metadata, scene_hash


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    """The file of an arm of one's own, with its surface."""
    library = Path(str(Scene(robot="ur5e").robot.file)).parent
    path = tmp_path / "my.yaml"
    path.write_text((library / "ur5e.yaml").read_text().replace("name: ur5e", "name: my", 1))
    (tmp_path / "my.surface.yaml").write_text((library / "ur5e.surface.yaml").read_text())
    return path


def _heavier(arm: Path) -> None:
    arm.write_text(re.sub("mass: [0-9.]+", "mass: 5.5", arm.read_text(), count=1))


def _recorded(path: Path, scene: Scene, start: float = 0.0) -> Path:
    still = np.zeros((20, 6))
    t = start + 0.002 * np.arange(20.0)
    export(Recording("made", t, still, still, still, None, None, np.arange(20)), path, scene=scene)
    return path


def test_a_recording_says_that_its_arm_is_another_one_now(arm: Path, tmp_path: Path) -> None:
    path = _recorded(tmp_path / "one.parquet", Scene(robot=arm, base_wrench=None))
    assert read(path).problems == ()
    _heavier(arm)
    (problem,) = read(path).problems
    assert problem.kind == "other_arm"
    assert str(problem).startswith("the arm that the scene names is not as it was")
    assert str(arm) in str(problem)
    # Another scene is meant to describe something else.
    assert read(path, Scene(robot=arm, base_wrench=None, gravity=9.8)).problems == ()


def test_recordings_of_two_versions_of_an_arm_have_different_scenes(arm: Path, tmp_path: Path) -> None:
    folder = tmp_path / "recordings"
    folder.mkdir()
    _recorded(folder / "a.parquet", Scene(robot=arm, base_wrench=None))
    _heavier(arm)
    _recorded(folder / "b.parquet", Scene(robot=arm, base_wrench=None), 1.0)
    with pytest.raises(RecordingError, match=r"a\.parquet and b\.parquet carry different scenes"):
        read(folder)


def test_the_surface_belongs_to_the_arm(arm: Path) -> None:
    before = scene_hash(Scene(robot=arm))
    surface = arm.with_suffix(".surface.yaml")
    surface.write_text(re.sub("radius_a: [0-9.]+", "radius_a: 0.05", surface.read_text(), count=1))
    assert scene_hash(Scene(robot=arm)) != before


def test_an_arm_of_the_library_needs_no_mark() -> None:
    assert "contactsense.arm_hash" not in metadata(Scene(robot="ur5e"))
