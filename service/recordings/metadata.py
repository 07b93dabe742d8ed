"""Metadata of a recording, stored in the schema: the scene, versions, clocks."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from datetime import UTC, datetime
from importlib.metadata import version

import numpy as np
import yaml
from pydantic import BaseModel, FiniteFloat, TypeAdapter, ValidationError

from contactsense import robots
from contactsense.robots.files.yaml_fields import Dumper, fields_in
from contactsense.robots.library import in_library
from contactsense.scene import Scene, describe
from contactsense.scene_model.sensor_delays import sensor_delays
from contactsense.service.recordings.problems import RecordingError

PREFIX = "contactsense."
_CREATED, _TABLE, _ARM = "created", "table", "arm_hash"
RAW = "samples"
"""Table of the recorder whose rows have every signal as received."""
_REMOVED = "removed_delays"
_DELAYS = TypeAdapter(dict[str, FiniteFloat])
CONFLICT = "scene_conflict"
"""Entry that names two files of a folder whose scenes differ."""


def scene_text(scene: Scene) -> str:
    """The scene as YAML."""
    return str(yaml.dump(scene.model_dump(mode="json", exclude_defaults=True), Dumper=Dumper, sort_keys=True))


def scene_hash(scene: Scene) -> str:
    """Short hash of all fields of a scene and of the arm that its files describe: recordings with the same
    hash have the same meaning."""
    text = json.dumps(scene.model_dump(mode="json"), sort_keys=True)
    return _short(text + arm_hash(scene))


def carried_scene(meta: Mapping[str, str]) -> str | None:
    """Short hash of the scene that a file carries; None if it carries none. Other than `scene_hash` it does
    not depend on the fields that a later version adds."""
    text = meta.get(PREFIX + "scene")
    return None if text is None else _short(text + meta.get(PREFIX + _ARM, ""))


def arm_hash(scene: Scene) -> str:
    """Short hash of an arm of one's own, or with a kinematic calibration: the scene's text only names its
    files, which may change. Empty for an arm of the library."""
    robot = scene.robot
    if in_library(robot) and robot == robots.load(robot.name):
        return ""
    described = asdict(replace(robot, file=None))
    return _short(json.dumps(described, sort_keys=True, default=plain))


def plain(value: object) -> object:
    """A part of a robot for JSON."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    return value.model_dump(mode="json") if isinstance(value, BaseModel) else str(value)


def other_arm(meta: Mapping[str, str], scene: Scene) -> str:
    """What is wrong where a file was recorded with this scene, but the files that it names described another
    arm then; empty if they did not."""
    recorded = meta.get(PREFIX + _ARM)
    if recorded is None or meta.get(PREFIX + "scene") != scene_text(scene) or recorded == arm_hash(scene):
        return ""
    names = " or ".join(str(path) for path in (scene.robot.file, scene.kinematics) if path is not None)
    return (
        f"the arm that the scene names is not as it was when this was recorded: {names} has changed, or its "
        "surface file"
    )


def _short(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def metadata(scene: Scene, **more: str) -> dict[str, str]:
    """Metadata of a new recording; `more` is added, without its prefix."""
    fields = {
        "scene": scene_text(scene),
        "scene_hash": scene_hash(scene),
        "robot": scene.robot.name,
        "version": version("contactsense"),
        **more,
    }
    if arm := arm_hash(scene):
        fields[_ARM] = arm
    return {PREFIX + name: value for name, value in fields.items()} | creation()


def creation() -> dict[str, str]:
    """Entry of `metadata` for a file that begins now."""
    return {PREFIX + _CREATED: datetime.now(UTC).isoformat(timespec="seconds")}


def date_of_meta(meta: Mapping[str, str]) -> str | None:
    """Day on which a file was recorded, YYYY-MM-DD in UTC, from its metadata; None where they do not tell, as
    those of a recording that was converted, which have the time of that."""
    created = meta.get(PREFIX + _CREATED)
    if created is None or PREFIX + _TABLE not in meta:
        return None
    try:
        return datetime.fromisoformat(created).astimezone(UTC).date().isoformat()
    except (ValueError, OverflowError):
        return None


def removed_delays(scene: Scene) -> dict[str, str]:
    """Entry of `metadata` for rows made of samples: the delays of the sensors have been taken off."""
    delays = sensor_delays(scene)
    return {_REMOVED: json.dumps({field: delay for field, delay in delays.items() if delay})}


def removed_delays_of_meta(meta: Mapping[str, str], name: str) -> dict[str, float]:
    """Field of a sensor -> the delay that has been taken off its readings [s]; only those that are not 0.

    Args:
        meta: Metadata of a file.
        name: Its name, for the error.

    Raises:
        RecordingError: The entry is damaged.
    """
    text = meta.get(PREFIX + _REMOVED, "{}")
    try:
        return _DELAYS.validate_json(text)
    except ValidationError:
        raise RecordingError(
            f"{name}: {PREFIX + _REMOVED} in its metadata: expected the delays that have been taken off the "
            f'sensors, as {{"base_wrench": 0.02}}, got {text!r:.60}'
        ) from None


def is_raw(meta: Mapping[str, str]) -> bool:
    """Whether a file's signals are also there as received, beside what a scene made of them."""
    return meta.get(PREFIX + _TABLE) == RAW


def recorded_scene(meta: Mapping[str, str]) -> Scene | None:
    """The scene with which an arm was recorded; None where the metadata do not tell."""
    if PREFIX + _TABLE not in meta:
        return None
    try:
        return scene_of_meta(meta, "")
    except RecordingError:
        return None


def scene_of_meta(meta: Mapping[str, str], name: str) -> Scene:
    """The scene in a recording's metadata.

    Raises:
        RecordingError: There is none, or it cannot be used.
    """
    text = meta.get(PREFIX + "scene")
    conflict = meta.get(PREFIX + CONFLICT)
    if conflict is not None:
        raise RecordingError(
            f"{name}: {conflict} carry different scenes: read them one by one, or name one for all with "
            "--scene"
        )
    if text is None:
        raise RecordingError(f"{name}: the file carries no scene: name one with --scene")
    try:
        return Scene.model_validate(fields_in(text, "the scene", "robot: ur5e"))
    except ValueError as error:
        reason = describe(error, Scene) if isinstance(error, ValidationError) else str(error)
        raise RecordingError(f"{name}: its scene cannot be used: {reason}") from None
