"""The arms included in this package, and robots from files."""

import functools
from collections.abc import Iterable
from dataclasses import replace
from importlib import resources
from pathlib import Path

from contactsense.robots import yaml_schema as schema
from contactsense.robots.errors import RobotError, SurfaceFileError, UnknownRobotError
from contactsense.robots.extras import install_command
from contactsense.robots.files.suffixes import MESH_SUFFIXES, URDF_SUFFIXES
from contactsense.robots.robot import Robot

EQUIVALENT_MODELS = {"ur7e": "ur5e", "ur12e": "ur10e"}
"""Models -> the arm in the library whose links and joints they have. They differ from it in the payload that
the controller permits (config/ur7e and config/ur12e of Universal_Robots_ROS2_Description, 4.1.1)."""


def names() -> tuple[str, ...]:
    """Names of the arms in the library, in the order of their numbers."""
    paths = (path for path in _folder().glob("*.yaml") if not path.name.endswith(".surface.yaml"))
    return sorted_by_number(path.stem for path in paths)


def known_names() -> tuple[str, ...]:
    """All names that `load` knows: `names` and the models that are one of these arms."""
    return sorted_by_number((*names(), *EQUIVALENT_MODELS))


def sorted_by_number(arms: Iterable[str]) -> tuple[str, ...]:
    """Names of arms in the order of their numbers: ur5e before ur10."""
    return tuple(sorted(arms, key=lambda name: (int("".join(filter(str.isdigit, name)) or 0), name)))


def load(name: str | Path) -> Robot:
    """Load an arm by its name in the library, or from a YAML file of the same format, or from a URDF.

    Args:
        name: One of `known_names()`, or a path that ends in `.yaml` or `.urdf`. Primitives are read from
            `<name>.surface.yaml` in the same folder.

    Raises:
        UnknownRobotError: the library has no such arm.
        RobotError: the file is missing or wrong; the message names the field.
    """
    path = Path(name)
    suffix = path.suffix.lower()  # some programs write names in capitals
    if suffix in URDF_SUFFIXES:
        return from_urdf(path)
    if suffix in MESH_SUFFIXES:
        raise RobotError(f"{path}: a mesh, not an arm; is it a tool? contactsense decompose {path} --as-tool")
    if suffix != ".yaml":
        if str(name) not in known_names():
            known = ", ".join(known_names())
            raise UnknownRobotError(
                f"unknown robot {str(name)!r}; there are {known}, or a path to .yaml or .urdf"
            )
        return _in_package(EQUIVALENT_MODELS.get(str(name), str(name)))
    return schema.robot(path)


@functools.cache
def _in_package(name: str) -> Robot:
    """An arm of the library: nothing of a robot can be changed, so that all share one."""
    return schema.robot(_folder() / f"{name}.yaml")


def from_urdf(path: str | Path, tip: str | None = None, name: str | None = None) -> Robot:
    """Load an arm from a URDF: kinematics, inertia, limits.

    Its surface is read from `<name>.surface.yaml` in the URDF's folder, which `contactsense decompose`
    creates.

    Args:
        path: The URDF.
        tip: Last link of the arm; by default, the one that `<name>.surface.yaml` names, else the end of the
            longest chain of revolute joints, without a gripper's fingers.
        name: Name of the robot; by default, the one in the URDF.

    Raises:
        RobotError: the file or an element in it cannot be used, or the packages of the `geometry` extra are
            missing; the message names what.
    """
    try:
        from contactsense.robots.urdf.read_urdf import from_urdf as read
    except ImportError as error:
        raise RobotError(
            f"{path}: a URDF needs the extra packages: {install_command('geometry')} ({error})"
        ) from error
    surface = Path(path).with_suffix(".surface.yaml")
    if not surface.exists():
        return read(path, tip, name)
    fitted = schema.read_surface(surface).tip
    if tip is not None and fitted not in (None, tip):
        raise SurfaceFileError(f"{surface}: tip: expected {tip}, but it was made for {fitted}")
    return schema.with_surface(read(path, fitted or tip, name), surface)


def in_library(robot: Robot) -> bool:
    """Whether it is the arm of the library that has its name, apart from a kinematic calibration."""
    if robot.file != _folder() / f"{robot.name}.yaml":
        return False
    arm = _in_package(robot.name)
    if robot is arm:
        return True
    if len(arm.joints) != len(robot.joints):
        return False
    joints = tuple(
        replace(joint, rotation=own.rotation, translation=own.translation)
        for joint, own in zip(robot.joints, arm.joints, strict=True)
    )
    return replace(robot, joints=joints) == arm


def is_library_file(path: Path) -> bool:
    """Whether a file belongs to the library."""
    return path.parent == _folder()


def surface_file(name: str) -> Path:
    """Path of the surface file of an arm in the library."""
    return _folder() / f"{name}.surface.yaml"


def _folder() -> Path:
    return Path(str(resources.files("contactsense.robots")))
