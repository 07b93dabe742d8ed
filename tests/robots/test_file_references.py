"""Paths in a scene that is read from one folder and written into another."""

import os
from pathlib import Path

import pytest

from contactsense.robots.file_references import located, moved

FIELDS = {"robot": "../arm.urdf", "kinematics": "arm.yaml", "meshes": "/meshes", "mounting": "table.yaml"}


def test_only_relative_paths_are_located() -> None:
    found = located(FIELDS, Path("/cells/a"))
    assert os.path.normpath(found["robot"]) == "/cells/arm.urdf"
    assert found["kinematics"] == "/cells/a/arm.yaml"
    assert (found["meshes"], found["mounting"]) == ("/meshes", "table.yaml")
    assert located({"robot": "ARM.URDF"}, Path("/cells")) == {"robot": "/cells/ARM.URDF"}
    assert located({"robot": "ur5e", "meshes": None}, Path("/cells")) == {"robot": "ur5e", "meshes": None}


def test_moved_fields_name_the_same_files() -> None:
    found = moved(FIELDS, Path("/cells/a"), Path("/new"))
    assert found == {**FIELDS, "robot": "../cells/arm.urdf", "kinematics": "../cells/a/arm.yaml"}
    assert moved(FIELDS, Path("/cells/a"), Path("/cells/b/../a")) == FIELDS


def test_a_file_that_is_not_beside_the_scene_may_be_in_the_working_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cell, work = tmp_path / "cell", tmp_path / "work"
    for folder in (cell, work):
        folder.mkdir()
    (work / "arm.urdf").touch()
    monkeypatch.chdir(work)
    assert located({"robot": "arm.urdf"}, cell) == {"robot": str(work / "arm.urdf")}
    assert moved({"robot": "arm.urdf"}, cell, tmp_path) == {"robot": "work/arm.urdf"}
    (cell / "arm.urdf").touch()
    assert located({"robot": "arm.urdf"}, cell) == {"robot": str(cell / "arm.urdf")}
