"""Scenes sent by a controller: a robot of the library, or a URDF. They cannot refer to files on this host."""

import re
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from contactsense import robots
from contactsense.robots import Robot, RobotError
from contactsense.robots.errors import SurfaceFileError
from contactsense.robots.files.field_errors import joined
from contactsense.scene import Scene, SceneError
from contactsense.service.controllers.sample_message import MessageError

MAX_URDF = 400_000
"""Largest URDF, and largest surface [characters]."""
_FILES = ("kinematics", "meshes")


def make_scene(fields: Any) -> Scene:
    """Create the scene from a message `{"scene": {...}}` with the fields of `Scene`. Instead of `robot` it
    may have `urdf`, the text of a URDF, with `surface`, the text of the file that `contactsense decompose`
    writes for it, and `tip`, the last link of the arm.

    Raises:
        MessageError: A field cannot be used.
    """
    if not isinstance(fields, Mapping):
        raise MessageError("scene", "expected an object with fields such as robot")
    if not all(isinstance(name, str) for name in fields):  # MessagePack has keys that are bytes
        raise MessageError("scene", "expected names of fields as text")
    given = dict(fields)
    for name in _FILES:
        if given.get(name) is not None:
            raise MessageError(f"scene.{name}", "names a file, which a message cannot do")
    if given.get("detail") == "skin":
        raise MessageError("scene.detail", "expected 'coarse' or 'fine': the meshes of 'skin' are files")
    urdf, surface, tip = (given.pop(name, None) for name in ("urdf", "surface", "tip"))
    if (urdf is None) == (given.get("robot") is None):
        raise MessageError("scene.robot", "expected either robot or urdf")
    if urdf is not None:
        given["robot"] = _robot(_text("urdf", urdf), _text("surface", surface), tip)
    elif given["robot"] not in robots.known_names():
        known = ", ".join(robots.known_names())
        raise MessageError("scene.robot", f"expected one of {known}, got {given['robot']!r:.40}")
    try:
        return Scene(**given)
    except SceneError as error:
        place, reason = next(iter(error.reasons.items()))
        raise MessageError(joined(("scene", *place)), reason[:1000]) from None


def _text(name: str, value: Any) -> str:
    if not isinstance(value, str):
        raise MessageError(f"scene.{name}", "expected the text of the file")
    if len(value) > MAX_URDF:
        raise MessageError(f"scene.{name}", f"expected at most {MAX_URDF} characters, got {len(value)}")
    return value


def _robot(urdf: str, surface: str, tip: Any) -> Robot:
    # The XML parser used for URDF would open files that a document type names.
    if "<!DOCTYPE" in urdf or "<!ENTITY" in urdf or "xi:include" in urdf:
        raise MessageError("scene.urdf", "expected no document type, no entities and no inclusions")
    declared = re.match(r"\s*<\?xml[^>]*encoding\s*=\s*['\"]([^'\"]*)", urdf)
    if declared and declared[1].lower() not in ("utf-8", "us-ascii"):
        raise MessageError("scene.urdf", f"expected UTF-8, got {declared[1]!r:.40}")
    if "&" in surface or "*" in surface:  # aliases could expand to a huge document
        raise MessageError("scene.surface", "expected no anchors and no aliases")
    if tip is not None and not isinstance(tip, str):
        raise MessageError("scene.tip", "expected the name of a link")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.urdf"
        path.write_text(urdf, encoding="utf-8")
        skin = path.with_suffix(".surface.yaml")
        skin.write_text(surface, encoding="utf-8")
        try:
            return robots.from_urdf(path, tip)
        except RobotError as error:
            reason = str(error).replace(f"{path.parent}/", "")
            field = "scene.surface" if isinstance(error, SurfaceFileError) else "scene.urdf"
            raise MessageError(
                field, reason.removeprefix(f"{skin.name}: ").removeprefix(f"{path.name}: ")
            ) from None
