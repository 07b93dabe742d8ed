"""Fitted primitives as the text of a `<name>.surface.yaml`."""

import sys
from collections.abc import Iterable, Mapping

import numpy as np
import yaml

from contactsense.robots.decomposition.least_squares_fit import Bodies
from contactsense.robots.files.yaml_fields import fields_in
from contactsense.robots.primitives import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    Primitive,
    Sphere,
    Vector,
)
from contactsense.robots.robot import Inertia
from contactsense.robots.rotations import rpy_from_rotation
from contactsense.robots.surface.convex_primitives import ELLIPSOID, REVOLVED

_TINY = 2e-5
"""Dimensions of a core below this count as zero [m]."""


def primitives(bodies: Bodies) -> tuple[Primitive, ...]:
    """Bodies as primitives, rounded to hundredths of a millimetre."""
    return tuple(
        primitive(int(kind), rotation, origin, size)
        for kind, rotation, origin, size in zip(*bodies, strict=True)
    )


def primitive(kind: int, rotation: np.ndarray, origin: np.ndarray, size: np.ndarray) -> Primitive:
    """One body of `contactsense.robots.surface.convex_primitives`, as the simplest primitive that fits it.

    `rotation`, `origin`: its frame in the link frame, shapes (3, 3) and (3,) [m]; `size`: its dimensions by
    kind [m].
    """
    if kind == REVOLVED:
        return _revolved(rotation[:, 2], origin, size)
    if kind == ELLIPSOID:
        a, b, c = (round(float(value), 5) for value in size[:3])
        return Ellipsoid(center=_vector(origin), rpy=_rpy(rotation), radii=(a, b, c))
    ball = round(float(size[3]), 5)
    x, y, z = (round(max(float(value), 0.0) + ball, 5) for value in size[:3])
    return Box(center=_vector(origin), rpy=_rpy(rotation), half=(x, y, z), rounding=ball)


def _revolved(axis: np.ndarray, origin: np.ndarray, size: np.ndarray) -> Primitive:
    h, R0, R1, r = (float(value) for value in size[:4])
    if max(R0, R1) < _TINY:
        if h < _TINY:
            return Sphere(center=_vector(origin), radius=round(r, 5))
        return Capsule(a=_vector(origin - h * axis), b=_vector(origin + h * axis), radius=round(r, 5))
    if h < _TINY:
        R0 = R1 = max(R0, R1)
    slope = (R1 - R0) / (2.0 * h) if R0 != R1 else 0.0
    grown = r * np.hypot(1.0, slope)
    start, end = _vector(origin - (h + r) * axis), _vector(origin + (h + r) * axis)
    radius_a, radius_b = round(R0 - slope * r + grown, 5), round(R1 + slope * r + grown, 5)
    # The ball is rounded down, so that it fits into the rounded cone: into its length, and at both caps.
    length = float(np.linalg.norm(np.subtract(end, start)))
    slope = (radius_b - radius_a) / length
    side = float(np.hypot(1.0, slope))
    ball = min(r, length / 2.0, radius_a / (side - slope), radius_b / (side + slope))
    return Cylinder(
        a=start,
        b=end,
        radius_a=radius_a,
        radius_b=radius_b,
        rounding=round(float(np.floor((ball - 1e-5) * 1e5) / 1e5), 5),
    )


def _vector(values: Iterable[float]) -> Vector:
    x, y, z = (round(float(value), 5) + 0.0 for value in values)
    return x, y, z


def _rpy(rotation: np.ndarray) -> Vector:
    """Roll, pitch, yaw about fixed axes of a rotation matrix [rad]."""
    roll, pitch, yaw = rpy_from_rotation(rotation)
    return round(roll, 4) + 0.0, round(pitch, 4) + 0.0, round(yaw, 4) + 0.0


def text(
    robot: str,
    links: Mapping[str, Mapping[str, Iterable[Primitive]]],
    comments: Iterable[str],
    seconds: float,
    tip: str | None = None,
    deviations: Mapping[str, Mapping[str, Iterable[str]]] | None = None,
) -> str:
    """Content of the YAML file: comments, then one primitive per line under link and level.

    Args:
        robot: Name of the robot.
        links: Link name -> level (`coarse`, `fine`) -> primitives.
        comments: Lines at the start of the file.
        seconds: Duration of the fit [s].
        tip: Last link of the arm in its URDF, if it was named.
        deviations: Link name -> level -> `contactsense.robots.surface.deviation_table.lines`.
    """
    lines = _commented(comments)
    lines += [
        f"robot: {_name(robot)}",
        *([f"tip: {_name(tip)}"] if tip else []),
        f"fit_seconds: {seconds:.0f}",
        "links:",
    ]
    for link, levels in links.items():
        lines.append(f"  {_name(link)}:")
        for level, shapes in levels.items():
            lines.append(f"    {level}:")
            for shape in shapes:
                lines.append(f"      - {_fields(shape)}")
        for level, cells in (deviations or {}).get(link, {}).items():
            lines += _indented(f"    {level}_deviation: |", cells)
    return "\n".join(lines) + "\n"


def tool_text(
    name: str, body: Inertia, shapes: Iterable[Primitive], cells: Iterable[str], comments: Iterable[str]
) -> str:
    """The field `tool` of a scene; mass, centre of mass and tensor only if the mass is known.

    Args:
        name: Of the tool.
        body: Its inertia.
        shapes: Its primitives.
        cells: `contactsense.robots.surface.deviation_table.lines`.
        comments: Lines at the start.
    """
    lines = _commented(comments)
    lines += ["tool:", f"  name: {_name(name)}"]
    if body.mass > 0.0:
        tensor = body.tensor[np.triu_indices(3)]
        lines += [
            f"  mass: {body.mass:.6g}",
            f"  com: [{', '.join(f'{value:.6g}' for value in body.com)}]",
            f"  tensor: [{', '.join(f'{value:.6g}' for value in tensor)}]",
        ]
    lines += ["  primitives:", *(f"    - {_fields(shape)}" for shape in shapes)]
    lines += _indented("  deviation: |", cells)
    return "\n".join(lines) + "\n"


def body_text(name: str, shapes: Iterable[Primitive], cells: Iterable[str], comments: Iterable[str]) -> str:
    """The field `bodies` of a scene, with one body. `cells` as for `tool_text`."""
    lines = _commented(comments)
    lines += [
        "bodies:",
        f"  - name: {_name(name)}",
        "    primitives:",
        *(f"      - {_fields(x)}" for x in shapes),
    ]
    lines += _indented("    deviation: |", cells)
    return "\n".join(lines) + "\n"


def _commented(comments: Iterable[str]) -> list[str]:
    lines = [line for comment in comments for line in comment.splitlines() or [""]]
    # YAML allows no control characters, not even in comments.
    return [f"# {''.join(c if c.isprintable() else '?' for c in line)}".rstrip() for line in lines]


def _name(name: str) -> str:
    """A name in YAML: in quotes where it would be read as something else, such as a number or a comment."""
    try:
        pair = f"{name}: {name}"
        if fields_in(pair, "", "") == {name: name} == yaml.safe_load(pair):
            return name
    except (yaml.YAMLError, ValueError):  # ValueError: a date that does not exist
        pass
    return str(yaml.safe_dump(name, default_style='"', width=sys.maxsize, allow_unicode=True)).rstrip("\n")


def _indented(head: str, lines: Iterable[str]) -> list[str]:
    """A field of several lines, indented by two blanks more than its head; nothing without lines."""
    blanks = " " * (len(head) - len(head.lstrip()) + 2)
    rows = [blanks + line for line in lines]
    return [head, *rows] if rows else []


def _fields(shape: Primitive) -> str:
    return "{" + ", ".join(f"{name}: {_plain(value)}" for name, value in shape.model_dump().items()) + "}"


def _plain(value: object) -> str:
    if isinstance(value, tuple):
        return "[" + ", ".join(_plain(entry) for entry in value) + "]"
    if isinstance(value, float):
        return f"{value:.5f}".rstrip("0").rstrip(".") if value else "0"
    return str(value)
