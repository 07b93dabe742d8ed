"""Metadata of a recording, stored in the schema: the scene, versions, clocks."""

import hashlib
import json
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib.metadata import version

import yaml
from pydantic import ValidationError

from contactsense.scene import Scene, describe
from contactsense.service.recordings.problems import RecordingError

PREFIX = "contactsense."


def scene_text(scene: Scene) -> str:
    """The scene as YAML."""
    return str(yaml.safe_dump(scene.model_dump(mode="json", exclude_defaults=True), sort_keys=True))


def scene_hash(scene: Scene) -> str:
    """Short hash of all fields of a scene: recordings with the same hash have the same meaning."""
    text = json.dumps(scene.model_dump(mode="json"), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def metadata(scene: Scene, **more: str) -> dict[str, str]:
    """Metadata of a new recording; `more` is added, without its prefix."""
    fields = {
        "scene": scene_text(scene),
        "scene_hash": scene_hash(scene),
        "robot": scene.robot.name,
        "version": version("contactsense"),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        **more,
    }
    return {PREFIX + name: value for name, value in fields.items()}


def scene_of_meta(meta: Mapping[str, str], name: str) -> Scene:
    """The scene in a recording's metadata.

    Raises:
        RecordingError: There is none, or it cannot be used.
    """
    text = meta.get(PREFIX + "scene")
    if text is None:
        raise RecordingError(f"{name}: the file carries no scene: name one with --scene")
    try:
        return Scene.model_validate(yaml.safe_load(text))
    except (ValidationError, yaml.YAMLError) as error:
        reason = describe(error, Scene) if isinstance(error, ValidationError) else str(error)
        raise RecordingError(f"{name}: its scene cannot be used: {reason}") from None
