"""Checks of the fields of a scene."""

from collections.abc import Container, Sequence

from pydantic import BaseModel

from contactsense.robots.primitives import Primitive
from contactsense.robots.surface.primitive_extent import beyond
from contactsense.robots.surroundings import Body
from contactsense.robots.tool import Tool
from contactsense.robots.units import FURTHEST, FURTHEST_BODY, in_metres, within_one_turn

LIGHTEST_ARM = 1.0
"""Mass [kg]: the links of a lighter arm have placeholders for their masses."""
LATEST = 0.5
"""Largest delay of a sensor [s]."""
FORMER_FIELDS = {
    "false_alarm": "this probability per sample is replaced by false_alarms_per_hour, how often noise alone "
    "may appear as a contact in an hour (default 0.01)",
    "room": "this field is now named clearance [m]",
}
"""Fields that scenes had before -> what takes their place."""


def in_seconds(delay: float) -> float:
    """A delay of a sensor [s] as it is.

    Raises:
        ValueError: it is beyond any sensor, as delays in ms are.
    """
    if abs(delay) > LATEST:
        raise ValueError(
            f"expected s, none above {LATEST:g}, got {delay:g}; if this is ms: {1e-3 * delay:.4g}"
        )
    return delay


def carried_by(arm: float, tool: Tool) -> None:
    """Check the mass, inertia and size of a tool.

    Args:
        arm: Mass of the arm [kg].
        tool: The tool.

    Raises:
        ValueError: One of them is beyond what any arm carries; the message names it.
    """
    field = "com"
    try:
        in_metres(tool.com)
        field = "mass"
        lighter_than(arm, tool.mass)
        field = "tensor"
        of_its_mass(tool.mass, tool.tensor)
    except ValueError as error:
        raise ValueError(f"tool.{field}: {error}") from None
    sized_in_metres("tool", tool.primitives)


def lighter_than(arm: float, tool: float) -> None:
    """Check the mass of a tool, or of one link [kg].

    Raises:
        ValueError: it is above that of the arm itself [kg], as masses in g are.
    """
    if tool > arm > LIGHTEST_ARM:
        raise ValueError(
            f"expected kg, at most the {arm:.4g} kg of the arm itself, got {tool:g}; "
            f"if this is g: {1e-3 * tool:.4g}"
        )


def of_its_mass(mass: float, tensor: Sequence[float]) -> None:
    """Check the inertia of a tool, or of a link, about its centre of mass, ixx, ixy, ixz, iyy, iyz, izz
    [kg m^2]. Without a mass [kg], which calibration may find, there is nothing to compare it with.

    Raises:
        ValueError: A moment is above that of the mass at the ends of the longest tool, as in kg mm^2.
    """
    largest = max(tensor[0], tensor[3], tensor[5])
    limit = mass * (0.5 * FURTHEST) ** 2
    if largest > limit > 0.0:
        meant = ", ".join(f"{1e-6 * moment:.4g}" for moment in tensor)
        raise ValueError(
            f"expected kg m^2, none above {limit:.4g} for {mass:g} kg, got {largest:g}; "
            f"if these are kg mm^2: [{meant}]"
        )


def sized_in_metres(
    place: str, primitives: Sequence[Primitive], furthest: float = FURTHEST, thickest: float = 0.0
) -> None:
    """Check the primitives of what can be touched: places of contacts are searched everywhere on them, which
    takes more time and memory than there is if they are a thousand times too large. With larger limits, those
    of other bodies of the cell: the arm would be inside one that is a thousand times too large.

    Args:
        place: Where the tool or body is in the scene.
        primitives: Those of its surface.
        furthest: Largest distance from their frame, and largest size [m].
        thickest: What is no thicker may be larger, such as a floor [m].

    Raises:
        ValueError: One is so large or far away that its numbers may be millimetres; the message names it.
    """
    for index, text in beyond(primitives, furthest, thickest):
        raise ValueError(f"{place}.primitives[{index}]: {text}")


def in_the_cell(place: str, body: Body) -> None:
    """Check the pose of a body, and its size.

    Args:
        place: Where the body is in the scene.
        body: The body.

    Raises:
        ValueError: A number cannot be one in m or rad; the message names the field.
    """
    field = "rpy"
    try:
        within_one_turn(body.rpy)
        field = "translation"
        in_metres(body.translation, FURTHEST_BODY)
    except ValueError as error:
        raise ValueError(f"{place}.{field}: {error}") from None
    if body.role == "pedestal":
        sized_in_metres(place, body.primitives)
    else:
        sized_in_metres(place, body.primitives, FURTHEST_BODY, thickest=FURTHEST)


def has_no_former_field(fields: Container[str]) -> None:
    """Check the names of a scene's fields.

    Raises:
        ValueError: One is that of a former field; the message says what takes its place.
    """
    for name, replacement in FORMER_FIELDS.items():
        if name in fields:
            raise ValueError(f"{name}: {replacement}")


def has_one_per_joint(place: str, part: BaseModel, joints: int) -> None:
    """Check the fields of a part of the scene that have one value per joint.

    Args:
        place: Name of the part.
        part: The part.
        joints: Number of joints of the arm.

    Raises:
        ValueError: A field has another number of values; the message names it.
    """
    for field, value in part:
        if isinstance(value, tuple) and len(value) != joints:
            what = "names" if field == "fields" else "numbers"
            raise ValueError(f"{place}.{field}: expected {joints} {what}, got {len(value)}")
