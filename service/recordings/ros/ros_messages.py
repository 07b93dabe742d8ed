"""ROS 2 messages as plain dictionaries, and their definitions: JointState, WrenchStamped, and the
SceneUpdate that Foxglove draws."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from contactsense.types import Contact

_LINE = "=" * 80
_SCENE_UPDATE = f"""foxglove_msgs/SceneEntityDeletion[] deletions
foxglove_msgs/SceneEntity[] entities
{_LINE}
MSG: foxglove_msgs/SceneEntityDeletion
builtin_interfaces/Time timestamp
uint8 type
string id
{_LINE}
MSG: foxglove_msgs/SceneEntity
builtin_interfaces/Time timestamp
string frame_id
string id
builtin_interfaces/Duration lifetime
bool frame_locked
foxglove_msgs/KeyValuePair[] metadata
foxglove_msgs/ArrowPrimitive[] arrows
foxglove_msgs/CubePrimitive[] cubes
foxglove_msgs/SpherePrimitive[] spheres
foxglove_msgs/CylinderPrimitive[] cylinders
foxglove_msgs/LinePrimitive[] lines
foxglove_msgs/TriangleListPrimitive[] triangles
foxglove_msgs/TextPrimitive[] texts
foxglove_msgs/ModelPrimitive[] models
{_LINE}
MSG: foxglove_msgs/KeyValuePair
string key
string value
{_LINE}
MSG: foxglove_msgs/ArrowPrimitive
geometry_msgs/Pose pose
float64 shaft_length
float64 shaft_diameter
float64 head_length
float64 head_diameter
foxglove_msgs/Color color
{_LINE}
MSG: foxglove_msgs/CubePrimitive
geometry_msgs/Pose pose
geometry_msgs/Vector3 size
foxglove_msgs/Color color
{_LINE}
MSG: foxglove_msgs/SpherePrimitive
geometry_msgs/Pose pose
geometry_msgs/Vector3 size
foxglove_msgs/Color color
{_LINE}
MSG: foxglove_msgs/CylinderPrimitive
geometry_msgs/Pose pose
geometry_msgs/Vector3 size
float64 bottom_scale
float64 top_scale
foxglove_msgs/Color color
{_LINE}
MSG: foxglove_msgs/LinePrimitive
uint8 type
geometry_msgs/Pose pose
float64 thickness
bool scale_invariant
geometry_msgs/Point[] points
foxglove_msgs/Color color
foxglove_msgs/Color[] colors
uint32[] indices
{_LINE}
MSG: foxglove_msgs/TriangleListPrimitive
geometry_msgs/Pose pose
geometry_msgs/Point[] points
foxglove_msgs/Color color
foxglove_msgs/Color[] colors
uint32[] indices
{_LINE}
MSG: foxglove_msgs/TextPrimitive
geometry_msgs/Pose pose
bool billboard
float64 font_size
bool scale_invariant
foxglove_msgs/Color color
string text
{_LINE}
MSG: foxglove_msgs/ModelPrimitive
geometry_msgs/Pose pose
geometry_msgs/Vector3 scale
foxglove_msgs/Color color
bool override_color
string url
string media_type
uint8[] data
{_LINE}
MSG: foxglove_msgs/Color
float64 r
float64 g
float64 b
float64 a"""
METRES_PER_NEWTON = 0.004
"""Length of a drawn force."""
_EMPTY = ("metadata", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")


def definitions() -> dict[str, str]:
    """The definitions of JointState, WrenchStamped and SceneUpdate, in this order, each with those of the
    messages in it.

    Raises:
        ImportError: rosbags, which has those of ROS, is not installed.
    """
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(_SCENE_UPDATE, "foxglove_msgs/msg/SceneUpdate"))
    kinds = ("sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped", "foxglove_msgs/msg/SceneUpdate")
    return {kind: store.generate_msgdef(kind, ros_version=2)[0] for kind in kinds}


def _time(t: float) -> dict[str, int]:
    seconds = math.floor(t)
    return {"sec": seconds, "nanosec": min(round(1e9 * (t - seconds)), 999_999_999)}


def _header(t: float, frame: str = "base") -> dict[str, Any]:
    return {"stamp": _time(t), "frame_id": frame}


def joint_state(
    t: float, names: Sequence[str], q: np.ndarray, qd: np.ndarray, torque: np.ndarray | None
) -> dict[str, Any]:
    """sensor_msgs/JointState of one sample, positions [rad], velocities [rad/s], efforts [Nm]."""
    effort = [] if torque is None else torque.tolist()
    return {
        "header": _header(t), "name": list(names), "position": q.tolist(), "velocity": qd.tolist(),
        "effort": effort,
    }  # fmt: skip


def wrench_stamped(t: float, wrench: np.ndarray, frame: str) -> dict[str, Any]:
    """geometry_msgs/WrenchStamped of a wrench in the axes of `frame` about its origin, shape (6,) [N, Nm]."""
    x, y, z, mx, my, mz = wrench.tolist()
    parts = {"force": {"x": x, "y": y, "z": z}, "torque": {"x": mx, "y": my, "z": mz}}
    return {"header": _header(t, frame), "wrench": parts}


def scene_update(t: float, contacts: Sequence[Contact]) -> dict[str, Any]:
    """foxglove_msgs/SceneUpdate that draws each contact's force as an arrow that ends at the contact
    point."""
    deletion = {"timestamp": _time(t), "type": 1, "id": ""}
    arrows = [_arrow(contact) for contact in contacts]
    entity = {
        "timestamp": _time(t), "frame_id": "base", "id": "contacts", "lifetime": {"sec": 0, "nanosec": 0},
        "frame_locked": True, "arrows": arrows, **{name: [] for name in _EMPTY},
    }  # fmt: skip
    return {"deletions": [] if arrows else [deletion], "entities": [entity] if arrows else []}


def _arrow(contact: Contact) -> dict[str, Any]:
    force = float(np.linalg.norm(contact.force_base))
    length = METRES_PER_NEWTON * force
    direction = contact.force_base / force if force > 0.0 else np.array([1.0, 0.0, 0.0])
    tail = contact.point_base - length * direction
    x, y, z, w = _quaternion_from_x(direction)
    head = min(0.03, 0.4 * length)
    return {
        "pose": {
            "position": dict(zip("xyz", tail.tolist(), strict=True)),
            "orientation": {"x": x, "y": y, "z": z, "w": w},
        },
        "shaft_length": length - head,
        "shaft_diameter": 0.008,
        "head_length": head,
        "head_diameter": 0.02,
        "color": {"r": 0.9, "g": 0.3, "b": 0.0, "a": max(contact.probability, 0.15)},
    }


def _quaternion_from_x(direction: np.ndarray) -> tuple[float, float, float, float]:
    """Quaternion of the rotation that takes the x axis to a unit vector, (x, y, z, w)."""
    dx, dy, dz = direction.tolist()
    if dx < -0.999999:
        return 0.0, 0.0, 1.0, 0.0
    w = math.sqrt(0.5 * (1.0 + dx))
    return 0.0, -dz / (2.0 * w), dy / (2.0 * w), w
