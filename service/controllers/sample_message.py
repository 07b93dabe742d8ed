"""Messages of `WS /v1/track`: one sample each, as JSON text or as MessagePack. Bytes in, samples out."""

import json
import math
from collections.abc import Mapping
from typing import Any

import msgpack
import numpy as np

from contactsense.scene import Scene
from contactsense.service.json_objects import ObjectError, parse_json
from contactsense.types import Sample

MAX_SAMPLE = 16_384
"""Largest message with a sample [bytes]."""
MAX_SCENE = 900_000
"""Largest message with a scene [bytes]."""
_REQUIRED = ("t", "q", "qd")
_SENSORS = ("joint_torque", "base_wrench", "wrist_wrench")
_BY_JOINT = frozenset(("q", "qd", "joint_torque"))
_LINKS = "link_wrenches"
_FIELDS = frozenset((*_REQUIRED, *_SENSORS, _LINKS))


class MessageError(ValueError):
    """A message cannot be used: the text gives the field, what was expected and what was received."""

    def __init__(self, field: str, reason: str) -> None:
        super().__init__(f"{field}: {reason}" if field else reason)
        self.field, self.reason = field, reason


def decode(message: bytes, binary: bool) -> dict[str, Any]:
    """Decode the object in a message.

    Args:
        message: The message's bytes.
        binary: Whether the message is MessagePack; otherwise it is JSON.

    Raises:
        MessageError: The message is too long or does not contain an object.
    """
    if len(message) > MAX_SCENE:
        raise MessageError("", f"expected at most {MAX_SCENE} bytes, got {len(message)}")
    try:
        content = msgpack.unpackb(message) if binary else parse_json(message)
    except ObjectError as error:
        raise MessageError(error.name, error.reason) from None
    except (ValueError, RecursionError, OverflowError, msgpack.UnpackException) as error:
        name = "MessagePack" if binary else "JSON"
        reason = " ".join(str(error).split())[:100] or type(error).__name__
        raise MessageError("", f"expected one object in {name}: {reason}") from None
    if not isinstance(content, dict):
        raise MessageError("", f"expected an object, got {_kind(content)}")
    return content


def encode(content: Mapping[str, Any], binary: bool) -> bytes:
    """Encode this object as a message, in the format of the controller's messages."""
    if binary:
        return bytes(msgpack.packb(content))
    return json.dumps(content, allow_nan=False, separators=(",", ":")).encode()


class SampleDecoder:
    """Decodes samples for one scene. Checks name, size and numbers of every field."""

    def __init__(self, scene: Scene) -> None:
        joints = len(scene.robot.joints)
        self._sizes = {"q": joints, "qd": joints, "joint_torque": joints, "base_wrench": 6, "wrist_wrench": 6}
        self._fitted = {name: getattr(scene, name) is not None for name in _SENSORS}
        self._link_names = frozenset(sensor.name for sensor in scene.link_wrenches)
        self._robot = scene.robot.name

    def sample(self, content: Mapping[str, Any], size: int = 0) -> Sample:
        """Create the sample from a decoded message of `size` bytes.

        Raises:
            MessageError: A field is missing, unknown, or has the wrong form.
        """
        if size > MAX_SAMPLE:
            raise MessageError("", f"expected at most {MAX_SAMPLE} bytes for a sample, got {size}")
        if not _FIELDS.issuperset(content):
            unknown = next(name for name in content if name not in _FIELDS)
            raise MessageError(f"{unknown!s:.40}", f"unknown field (known: {', '.join(sorted(_FIELDS))})")
        for name in _REQUIRED:
            if name not in content:
                raise MessageError(name, "expected a value, the field is missing")
        return Sample(
            _number("t", content["t"]),
            self._vector("q", content["q"]),
            self._vector("qd", content["qd"]),
            self._sensor("joint_torque", content.get("joint_torque")),
            self._sensor("base_wrench", content.get("base_wrench")),
            self._sensor("wrist_wrench", content.get("wrist_wrench")),
            self._links(content.get(_LINKS)),
        )

    def _links(self, value: Any) -> dict[str, np.ndarray] | None:
        if value is None:
            return None
        if not isinstance(value, dict):
            raise MessageError(_LINKS, f"expected an object with a wrench for each name, got {_kind(value)}")
        for name in value:
            if name not in self._link_names:
                raise MessageError(
                    f"{_LINKS}.{name!s:.40}",
                    "the scene has no such sensor; leave it out or add it to the scene",
                )
        return {
            name: self._vector(f"{_LINKS}.{name}", wrench)
            for name, wrench in value.items()
            if wrench is not None
        }

    def _sensor(self, name: str, value: Any) -> np.ndarray | None:
        if value is None:
            return None
        if not self._fitted[name]:
            raise MessageError(name, "the scene has no such sensor; leave it out or add it to the scene")
        return self._vector(name, value)

    def _vector(self, name: str, value: Any) -> np.ndarray:
        size = self._sizes.get(name, 6)
        if not isinstance(value, list) or len(value) != size:
            got = f"{len(value)}" if isinstance(value, list) else _kind(value)
            what = (
                f"{size} numbers"
                if name not in _BY_JOINT
                else f"{size} numbers, one per joint of {self._robot}"
            )
            raise MessageError(name, f"expected a list of {what}, got {got}")
        return np.array([_number(name, item) for item in value])


def _number(name: str, value: Any) -> float:
    if type(value) is float and math.isfinite(value):
        return value
    if type(value) is int and abs(value) < 1 << 53:
        return float(value)
    raise MessageError(name, f"expected finite numbers, got {_kind(value)}")


def _kind(value: Any) -> str:
    """Describe the received value in a few words."""
    if value is None:
        return "null"
    if isinstance(value, bool | int | float):
        return f"{value!r:.40}"
    names: dict[type, str] = {dict: "an object", list: "a list", str: "text", bytes: "bytes"}
    return names.get(type(value), type(value).__name__)
