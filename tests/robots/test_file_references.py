"""Paths in a scene that is read from one folder and written into another."""

import os
from pathlib import Path

from contactsense.robots.file_references import located, moved

FIELDS = {"robot": "../arm.urdf", "kinematics": "arm.yaml", "meshes": "/meshes", "mounting": "table.yaml"}


def test_only_relative_paths_are_located() -> None:
    found = located(FIELDS, Path("/cells/a"))
    assert os.path.normpath(found["robot"]) == "/cells/arm.urdf"
    assert found["kinematics"] == "/cells/a/arm.yaml"
    assert (found["meshes"], found["mounting"]) == ("/meshes", "table.yaml")
    assert located({"robot": "ur5e", "meshes": None}, Path("/cells")) == {"robot": "ur5e", "meshes": None}


def test_moved_fields_name_the_same_files() -> None:
    found = moved(FIELDS, Path("/cells/a"), Path("/new"))
    assert found == {**FIELDS, "robot": "../cells/arm.urdf", "kinematics": "../cells/a/arm.yaml"}
    assert moved(FIELDS, Path("/cells/a"), Path("/cells/b/../a")) == FIELDS
