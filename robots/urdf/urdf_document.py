"""Read a URDF and check that it is one tree of links: what is wrong is reported in one line, with the
element."""

import contextlib
import logging
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

import yourdfpy

from contactsense.robots.errors import RobotError
from contactsense.robots.units import FURTHEST, FURTHEST_BODY, in_metres, within_one_turn

TURNING = ("revolute", "continuous")
MOVING = (*TURNING, "prismatic", "planar", "floating")
_SHAPES = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",), "mesh": ("filename",)}
"""Shapes -> the attributes that each needs."""
_NUMBERS = {
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
    "limit": ("lower", "upper", "effort", "velocity"),
    "mimic": ("multiplier", "offset"),
}
"""Elements of links and joints -> their attributes that are one number each."""


def read_document(path: Path) -> Any:
    """The `yourdfpy.Robot` of a URDF.

    Raises:
        RobotError: the file is missing, is xacro or SDF instead, or its links and joints are not one tree.
    """
    if not path.exists():
        where = "" if path.is_absolute() else f" in {Path.cwd()}"
        raise RobotError(f"{path}: no such file{where}")
    _check_kind(path)
    try:
        with _without_log():
            model = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=False).robot
    except KeyError as error:
        raise RobotError(f"{path}: no valid URDF: an element lacks the attribute {error}") from error
    except (ElementTree.ParseError, SyntaxError, ValueError, TypeError, AttributeError) as error:
        raise RobotError(f"{path}: no valid URDF: {' '.join(str(error).split())}") from error
    _check_names(path, "link", (link.name for link in model.links))
    _check_names(path, "joint", (joint.name for joint in model.joints))
    links = {link.name for link in model.links}
    for joint in model.joints:
        if joint.type not in (*MOVING, "fixed"):
            raise RobotError(
                f"{path}: joint {joint.name}: type: expected one of {', '.join((*MOVING, 'fixed'))}, "
                f"got {joint.type}"
            )
        for end in (joint.parent, joint.child):
            if end not in links:
                raise RobotError(f"{path}: joint {joint.name}: there is no link {end}")
    for child, count in Counter(j.child for j in model.joints if j.child != j.parent).items():
        if count > 1:
            parents = ", ".join(joint.name for joint in model.joints if joint.child == child)
            raise RobotError(f"{path}: link {child}: expected one joint that carries it, got {parents}")
    return model


@contextlib.contextmanager
def _without_log() -> Iterator[None]:
    """Keep the reader from printing that it tolerates a prefix without a namespace."""
    log = logging.getLogger("yourdfpy.urdf")
    before, log.disabled = log.disabled, True
    try:
        yield
    finally:
        log.disabled = before


def _check_kind(path: Path) -> None:
    """Refuse xacro and SDF with a hint."""
    try:
        root = _root_element(path)
    except OSError as error:
        raise RobotError(f"{path}: {error.strerror}") from error
    except expat.ExpatError as error:
        # The reader of URDFs recovers what it can: of a file that is cut short, a shorter arm.
        raise RobotError(f"{path}: no valid URDF: {error}") from error
    if root.tag == "sdf":
        raise RobotError(f"{path}: expected URDF, got SDF; convert it first, for example with sdf2urdf")
    if _is_xacro(root):
        expanded = path.name.removesuffix(".xacro").removesuffix(".urdf") + "_expanded.urdf"
        raise RobotError(f"{path}: expected URDF, got xacro; expand it first: xacro {path.name} > {expanded}")
    if root.tag != "robot":
        raise RobotError(f"{path}: expected URDF with the root element robot, got {root.tag}")
    if "xmlns" in root.attrib:
        raise RobotError(f"{path}: expected URDF without a namespace, got xmlns={root.attrib['xmlns']!r}")
    for body in root:
        if body.tag == "joint":
            _check_ends(path, body)
        if body.tag in ("link", "joint"):
            _check_numbers(path, body)
            _check_shapes(path, body)


def _root_element(path: Path) -> ElementTree.Element:
    """The root of the XML, read without namespaces: URDFs of simulators have elements such as
    drake:acceleration without that of the prefix."""
    tree, parser = ElementTree.TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = tree.start, tree.end
    with path.open("rb") as file:
        parser.ParseFile(file)
    return tree.close()


def _check_ends(path: Path, joint: ElementTree.Element) -> None:
    """Refuse a joint without one of its two links: the reader's own message does not name it."""
    for tag in ("parent", "child"):
        if joint.find(tag) is None:
            raise RobotError(f"{path}: joint {joint.get('name')}: expected the element {tag}, got none")


def _check_numbers(path: Path, body: ElementTree.Element) -> None:
    """Refuse places and directions of a link or joint that are in other units than m and rad, and what is no
    number: the reader's own message does not name the element.

    Shapes and fixed joints may be far away: an arm in a hall, or a mesh in the coordinates of its assembly.
    """
    for parent in body.iter():
        is_near = parent.tag == "inertial" or (parent.tag == "joint" and parent.get("type") != "fixed")
        furthest = FURTHEST if is_near else FURTHEST_BODY
        for element in parent:
            for name in ("xyz", "rpy"):
                if element.tag in ("origin", "axis") and name in element.attrib:
                    _check_triple(path, body, element, name, furthest)
            for name in _NUMBERS.get(element.tag, ()):
                _check_number(path, body, element, name)


def _check_shapes(path: Path, body: ElementTree.Element) -> None:
    """Refuse shapes that URDF does not have: the reader's own message does not name the link."""
    for parent in body:
        for geometry in parent.findall("geometry"):
            got = [shape.tag for shape in geometry]
            if len(got) != 1 or got[0] not in _SHAPES:
                raise RobotError(
                    f"{path}: {body.tag} {body.get('name')}: {parent.tag}: geometry: expected one of "
                    f"{', '.join(_SHAPES)}, got {', '.join(got) or 'none'}"
                )
            for name in _SHAPES[got[0]]:
                if not geometry[0].get(name):
                    raise RobotError(
                        f"{path}: {body.tag} {body.get('name')}: {parent.tag}: {got[0]}: expected the "
                        f"attribute {name}, got none"
                    )


def _check_triple(
    path: Path, body: ElementTree.Element, element: ElementTree.Element, name: str, furthest: float
) -> None:
    """Refuse an attribute that is not three numbers, or an origin beyond `furthest` [m] or one turn."""
    text = element.attrib[name]
    where = f"{path}: {body.tag} {body.get('name')}: {element.tag}: {name}"
    try:
        x, y, z = map(float, text.split())
    except ValueError:
        raise RobotError(f"{where}: expected three numbers, got {text!r}") from None
    if element.tag == "axis":
        return
    try:
        if name == "xyz":
            in_metres((x, y, z), furthest)
        else:
            within_one_turn((x, y, z))
    except ValueError as error:
        raise RobotError(f"{where}: {error}") from None


def _check_number(path: Path, body: ElementTree.Element, element: ElementTree.Element, name: str) -> None:
    """Refuse an attribute that is not one number."""
    text = element.get(name)
    if text is None:
        return
    try:
        float(text)
    except ValueError:
        where = f"{path}: {body.tag} {body.get('name')}: {element.tag}: {name}"
        raise RobotError(f"{where}: expected a number, got {text!r}") from None


def _is_xacro(root: ElementTree.Element) -> bool:
    """Whether links or joints are yet to be expanded; expanded files may keep traces of xacro elsewhere."""
    bodies = [element for element in root if element.tag in ("link", "joint")]
    if not bodies:
        return any("xacro" in element.tag for element in root)
    return any(
        "${" in value or "$(" in value
        for body in bodies
        for element in body.iter()
        for value in element.attrib.values()
    )


def _check_names(path: Path, what: str, names: Iterable[str]) -> None:
    for name, count in Counter(names).items():
        if count > 1:
            raise RobotError(f"{path}: {what} {name}: the name is given {count} times")
