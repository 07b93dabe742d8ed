"""The scene that the settings name."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from contactsense.service.api.scene_file import load_scene
from contactsense.service.api.settings import Settings, SettingsError
from contactsense.service.cli.scene_show import show


def test_an_unknown_robot_is_told_the_names() -> None:
    with pytest.raises(SettingsError, match=r"unknown robot .ur7.; there are .*ur5e"):
        load_scene(Settings(robot="ur7"))


def test_a_missing_scene_file(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"none\.yaml"):
        load_scene(Settings(scene=tmp_path / "none.yaml"))


def test_missing_meshes_are_told_at_the_start(tmp_path: Path) -> None:
    """Not by a traceback of each process that loads the scene."""
    pytest.importorskip("trimesh")
    (tmp_path / "scene.yaml").write_text(f"robot: ur5e\ndetail: skin\nmeshes: {tmp_path / 'none'}\n")
    with pytest.raises(SettingsError, match=r"scene\.yaml: meshes: .*none: no such folder of meshes"):
        load_scene(Settings(scene=tmp_path / "scene.yaml"))
    shown = CliRunner().invoke(show, [str(tmp_path / "scene.yaml")])
    assert shown.exit_code == 1
    assert "no such folder of meshes" in shown.output


def test_another_robot_than_that_of_the_scene_is_refused(tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text("robot: ur5e\n")
    assert load_scene(Settings(scene=tmp_path / "scene.yaml", robot="ur5e")).robot.name == "ur5e"
    with pytest.raises(
        SettingsError, match=r"--robot: expected ur5e, the robot of .*scene.yaml.* got 'ur10e'"
    ):
        load_scene(Settings(scene=tmp_path / "scene.yaml", robot="ur10e"))
