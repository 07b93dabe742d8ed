"""Fields of a scene that name files. In a scene file they are relative to the folder of that file; where no
such file is there, they are relative to the working folder."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from contactsense.robots.files.suffixes import URDF_SUFFIXES

_FIELDS = ("robot", "kinematics", "meshes")


def located(fields: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The fields of a scene file in `folder`, with the absolute paths of the files that they name."""
    return {**fields, **{name: str(_place(folder, fields[name])) for name in _relative(fields)}}


def moved(fields: Mapping[str, Any], before: Path, after: Path) -> dict[str, Any]:
    """The fields of a scene file in folder `before` as they are to be written into folder `after`."""
    if before.resolve() == after.resolve():
        return dict(fields)
    start = after.resolve()
    return {
        **fields,
        **{
            name: os.path.relpath(_place(before, fields[name]).resolve(), start) for name in _relative(fields)
        },
    }


def _place(folder: Path, path: str) -> Path:
    beside = (folder / path).absolute()
    return Path(path).absolute() if Path(path).exists() and not beside.exists() else beside


def _relative(fields: Mapping[str, Any]) -> list[str]:
    """Names of the fields that contain a relative path. An arm of the library has a name instead."""
    return [
        name
        for name in _FIELDS
        if isinstance(value := fields.get(name), str)
        and value  # an empty one is no path
        and not Path(value).is_absolute()
        and (name != "robot" or Path(value).suffix.lower() in (*URDF_SUFFIXES, ".yaml"))
    ]
