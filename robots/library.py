"""The arms included in this package, and robots from files."""

from importlib import resources
from pathlib import Path

from contactsense.robots import yaml_schema as schema
from contactsense.robots.robot import Robot
from contactsense.robots.yaml_schema import RobotError


class UnknownRobotError(RobotError):
    """A name that the library does not have; the message lists those that it has."""


def names() -> tuple[str, ...]:
    """Names of the arms that `load` knows."""
    return tuple(
        sorted(path.stem for path in _folder().glob("*.yaml") if not path.name.endswith(".surface.yaml"))
    )


def load(name: str | Path) -> Robot:
    """An arm by its name in the library, or from a YAML file of the same form, or a URDF.

    Args:
        name: One of `names()`, or a path that ends in `.yaml` or `.urdf`. Primitives are read from
            `<name>.surface.yaml` beside it.

    Raises:
        UnknownRobotError: the library has no such arm.
        RobotError: the file is missing or wrong; the message names the field.
    """
    path = Path(name)
    if path.suffix == ".urdf":
        return from_urdf(path)
    if path.suffix != ".yaml":
        if str(name) not in names():
            known = ", ".join(names())
            raise UnknownRobotError(
                f"unknown robot {str(name)!r}; there are {known}, or a path to .yaml or .urdf"
            )
        path = _folder() / f"{name}.yaml"
    return schema.robot(path)


def from_urdf(path: str | Path, tip: str | None = None, name: str | None = None) -> Robot:
    """An arm from a URDF: kinematics, inertia, limits.

    Its surface is read from `<name>.surface.yaml` beside the URDF, which `contactsense decompose` makes.

    Args:
        path: The URDF.
        tip: Last link of the arm; without it, the longest chain of revolute joints.
        name: Of the robot; without it, the URDF's own.

    Raises:
        RobotError: the file or an element in it cannot be used; the message names both.
        ImportError: the packages of the `geometry` extra are missing.
    """
    from contactsense.robots import urdf

    robot = urdf.from_urdf(path, tip, name)
    surface = Path(path).with_suffix(".surface.yaml")
    return schema.with_surface(robot, surface) if surface.exists() else robot


def surface_file(name: str) -> Path:
    """Where the surface of an arm of the library is kept."""
    return _folder() / f"{name}.surface.yaml"


def _folder() -> Path:
    return Path(str(resources.files("contactsense.robots")))
