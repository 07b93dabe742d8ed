"""Checks of the fields of a scene that name links, or bodies beside them: all fit the arm and each other.

All raise a ValueError that names the field, what was expected and what was given.
"""

from collections.abc import Iterable, Mapping, Sequence

from contactsense.robots import Robot
from contactsense.robots.surroundings import Body
from contactsense.sensors.field_checks import in_the_cell
from contactsense.sensors.settings import LinkWrenchSensor


def are_among(field: str, given: Iterable[str], links: Sequence[str]) -> None:
    """Check that names in a field are those of links."""
    for name in given:
        if name not in links:
            raise ValueError(f"{field}: expected links of {', '.join(links)}, got {name!r}")


def has_surface(robot: Robot, links: Sequence[str], touchable: Sequence[str] | None) -> None:
    """Check that a link can be touched: without one, no contact could ever be explained.

    Args:
        robot: The arm.
        links: Names of its links, and of a tool with a surface.
        touchable: Names of the links on which contacts are searched; None: all.
    """
    if touchable is not None and not touchable:
        raise ValueError("touchable: expected at least one link, got none")
    if _bare(robot).issuperset(links if touchable is None else touchable):
        field = "robot" if touchable is None else "touchable"
        raise ValueError(
            f"{field}: expected at least one link with a surface, got none on {robot.name}; "
            "`contactsense decompose` makes surfaces from meshes"
        )


def has_weights(
    robot: Robot, touchable: Sequence[str], bodies: Sequence[Body], weights: Mapping[str, float]
) -> None:
    """Check that the weights of the prior over links are those of the touchable links.

    Args:
        robot: The arm.
        touchable: Names of the links on which contacts are searched.
        bodies: Bodies of the cell: a pedestal counts as part of the base link.
        weights: Weight of each link by name.
    """
    bare, base = _bare(robot), robot.link_names[0]
    expected = [name for name in touchable if name not in bare]
    if base not in expected and any(body.role == "pedestal" for body in bodies):
        expected.insert(0, base)
    for name in weights:
        if name not in expected:
            raise ValueError(f"link_prior: expected touchable links of {', '.join(expected)}, got {name!r}")
    missing = [name for name in expected if name not in weights]
    if missing:
        raise ValueError(f"link_prior: expected a weight of each touchable link, got none of {missing[0]}")
    if not any(weights.values()):
        raise ValueError("link_prior: expected a weight above 0, got none")


def are_between_links(sensors: Sequence[LinkWrenchSensor], links: Sequence[str]) -> None:
    """Check that each sensor within the arm names a moved link, and no name is given twice.

    Args:
        sensors: The sensors.
        links: Names of the arm's links, base first.
    """
    names = [sensor.name for sensor in sensors]
    for index, sensor in enumerate(sensors):
        if sensor.link not in links[1:]:
            raise ValueError(
                f"link_wrenches[{index}].link: expected one of {', '.join(links[1:])}, got {sensor.link!r}"
            )
        if names.index(sensor.name) < index:
            raise ValueError(
                f"link_wrenches[{index}].name: expected a name that no other sensor has, got {sensor.name!r}"
            )


def fit_the_cell(bodies: Sequence[Body], links: Sequence[str], has_base_sensor: bool) -> None:
    """Check that each body has a name of its own and a pose in the cell, and a pedestal a sensor below it.

    Args:
        bodies: Bodies of the cell.
        links: Names of all links.
        has_base_sensor: Whether there is a force/torque sensor under the base.
    """
    names = list(links)
    for index, body in enumerate(bodies):
        if body.name in names:
            raise ValueError(
                f"bodies[{index}].name: expected a name that no link and no other body has, got {body.name!r}"
            )
        if body.role == "pedestal" and not has_base_sensor:
            raise ValueError(
                f"bodies[{index}].role: pedestal: expected a base_wrench below it, got none; "
                "a body below the sensor is a cover"
            )
        in_the_cell(f"bodies[{index}]", body)
        names.append(body.name)


def _bare(robot: Robot) -> set[str]:
    """Names of the links without a surface."""
    return {link.name for link in robot.links if not link.primitives}
