"""An arm from a URDF: the chain of its revolute joints, with the parts that each link carries.

Parts behind fixed joints belong to the link that carries them, and so do those behind all other joints, such
as a gripper's, which are held at zero.
"""

from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from .arm import AXIS, Arm, Link
from .urdf import limits, mesh, mesh_path, numbers, pose, solid, symmetric

_TURNING = ("revolute", "continuous")
Element = ElementTree.Element
Placed = tuple[np.ndarray, np.ndarray]
"""Origin, shape (3,) [m], and rotation, shape (3, 3), of one frame in another."""
HERE: Placed = (np.zeros(3), np.eye(3))


class _Tree(NamedTuple):
    """Links and joints of a URDF by their names."""

    path: Path
    links: dict[str, Element]
    above: dict[str, Element]
    """Link -> the joint that it hangs on."""
    below: dict[str, list[Element]]
    """Link -> the joints that hang on it."""


class _Body:
    """Rigidly connected parts, in the frame of the first one."""

    def __init__(self) -> None:
        self.vertices, self.faces = np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
        self.mass, self.moment, self.tensor = 0.0, np.zeros(3), np.zeros((3, 3))

    def add(self, part: Element, where: Placed, urdf: Path) -> None:
        """Add a link of the URDF, which is placed in the frame of the body."""
        origin, rotation = where
        for visual in part.findall("visual"):
            shift, turn = pose(visual)
            vertices, faces = _surface(visual, urdf)
            self.faces = np.concatenate((self.faces, faces + len(self.vertices)))
            self.vertices = np.concatenate((self.vertices, (vertices @ turn.T + shift) @ rotation.T + origin))
        inertial = part.find("inertial")
        if inertial is None:
            return
        shift, turn = pose(inertial)
        found, inertia = inertial.find("mass"), inertial.find("inertia")
        if found is None or inertia is None:
            raise ValueError("inertial: expected mass and inertia, found none")
        mass = numbers(found, "value", 1)[0]
        axes = ("xx", "xy", "xz", "yy", "yz", "zz")
        own = symmetric(*(numbers(inertia, f"i{name}", 1)[0] for name in axes))
        com, turn = origin + rotation @ shift, rotation @ turn
        self.mass += mass
        self.moment += mass * com
        self.tensor += turn @ own @ turn.T + mass * _point_inertia(com)

    def link(self, name: str, where: Placed, axis: np.ndarray) -> Link:
        """The body as a link, whose joint has an origin and a rotation in the link before."""
        com = self.moment / self.mass if self.mass > 0.0 else np.zeros(3)
        tensor = self.tensor - self.mass * _point_inertia(com)
        return Link(name, *where, axis, self.vertices, self.faces, self.mass, com, tensor)


def read(path: Path, tip: str | None = None, name: str | None = None, package: str | None = None) -> Arm:
    """The arm of a URDF.

    Args:
        path: The URDF. Names of meshes that begin with a package are sought in the folders above it.
        tip: Last link of the arm, or one that it carries; default: the end of the longest chain of turning
            joints.
        name: Name of the arm; default: that of the file.
        package: Python package that the file belongs to.

    Raises:
        OSError: the file or a mesh cannot be read.
        ValueError: the file is no URDF, has no such arm, or a mesh has no facets; the message names it.
    """
    try:
        document = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise ValueError(f"{path}: expected a URDF, got a document that cannot be parsed: {error}") from None
    tree = _tree(path, document)
    way = _way(tree, tip)
    turning = [joint for joint in way if _turns(joint)]
    if not turning:
        raise ValueError(f"{path}: expected an arm with revolute joints, found none")
    root = _parent(way[0])
    names = [root, *(_child(joint) for joint in turning)]
    links, place = [], {root: HERE}
    for number, link in enumerate(names):
        body = _Body()
        for part, where in _parts(tree, link, set(names)):
            place[part] = where
            try:
                body.add(tree.links[part], where, path)
            except ValueError as error:
                raise ValueError(f"{path}: link {part}: {error}") from None
        joint = turning[number - 1] if number else None
        links.append(_finished(body, link, joint, place, path))
    if not any(len(link.faces) for link in links):
        raise ValueError(f"{path}: expected links with visual shapes, found none")
    return Arm(name or path.stem, tuple(links), *limits(turning, path), package)


def _finished(body: _Body, link: str, joint: Element | None, place: dict[str, Placed], path: Path) -> Link:
    """A link of the arm behind its joint; `place`: of each part in the link that carries it."""
    if joint is None:
        return body.link(link, HERE, AXIS)
    element = joint.find("axis")
    try:
        axis = np.array([1.0, 0.0, 0.0]) if element is None else numbers(element, "xyz", 3)
    except ValueError as error:
        raise ValueError(f"{path}: joint {joint.attrib['name']}: {error}") from None
    length = float(np.linalg.norm(axis))
    if not length > 0.0:
        raise ValueError(f"{path}: joint {joint.attrib['name']}: expected an axis, got 0 0 0")
    shift, turn = _origin(joint, path)
    origin, rotation = place[_parent(joint)]
    moved = body.link(link, (origin + rotation @ shift, rotation @ turn), axis / length)
    moments = np.linalg.eigvalsh(moved.tensor)
    if not (moved.mass > 0.0 and moments[0] > 0.0):
        raise ValueError(
            f"{path}: link {link}: expected a mass and principal moments above zero, as it moves, got "
            f"{moved.mass:g} kg and {', '.join(f'{value:.3g}' for value in moments)} kg m^2"
        )
    return moved


def _tree(path: Path, document: Element) -> _Tree:
    links = {link.attrib["name"]: link for link in document.findall("link")}
    joints = document.findall("joint")
    below: dict[str, list[Element]] = {name: [] for name in links}
    for joint in joints:
        for name in (_parent(joint), _child(joint)):
            if name not in links:
                raise ValueError(f"{path}: joint {joint.attrib['name']}: there is no link {name!r}")
        below[_parent(joint)].append(joint)
    return _Tree(path, links, {_child(joint): joint for joint in joints}, below)


def _way(tree: _Tree, tip: str | None) -> list[Element]:
    """Joints from the root to the tip."""
    if tip is not None:
        if tip not in tree.links:
            raise ValueError(f"{tree.path}: there is no link {tip!r}; links are {', '.join(tree.links)}")
        return _above(tree, tip)
    ways = [_above(tree, link) for link in tree.links]
    return max(ways, key=lambda way: sum(map(_turns, way)), default=[])


def _above(tree: _Tree, link: str) -> list[Element]:
    """Joints from the root to a link."""
    way: list[Element] = []
    while link in tree.above:
        if tree.above[link] in way:
            raise ValueError(f"{tree.path}: link {link}: expected a tree of links, got a loop")
        way.insert(0, tree.above[link])
        link = _parent(way[0])
    return way


def _turns(joint: Element) -> bool:
    """Whether a joint turns, by itself."""
    return joint.attrib.get("type") in _TURNING and joint.find("mimic") is None


def _parts(tree: _Tree, first: str, others: set[str]) -> list[tuple[str, Placed]]:
    """Parts that are rigid with a link of the arm, and their frames in that of the link; the first part is
    the link itself."""
    found: list[tuple[str, Placed]] = [(first, HERE)]
    for part, (origin, rotation) in found:
        for joint in tree.below[part]:
            if _child(joint) not in others:
                shift, turn = _origin(joint, tree.path)
                found.append((_child(joint), (origin + rotation @ shift, rotation @ turn)))
    return found


def _origin(joint: Element, path: Path) -> Placed:
    """Of a joint of a file, in the frame of its parent."""
    try:
        return pose(joint)
    except ValueError as error:
        raise ValueError(f"{path}: joint {joint.attrib['name']}: {error}") from None


def _surface(visual: Element, urdf: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and facets of a visual, in its own frame."""
    shape = visual.find("geometry/*")
    if shape is None:
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    if shape.tag != "mesh":
        return solid(shape)
    vertices, faces = mesh(mesh_path(shape.attrib.get("filename", ""), urdf))
    scale = numbers(shape, "scale", 3, "1 1 1")
    # A mirrored facet has its corners in the other order.
    return vertices * scale, faces if np.prod(scale) > 0.0 else faces[:, ::-1]


def _attribute(element: Element, child: str, name: str) -> str | None:
    found = element.find(child)
    return None if found is None else found.attrib.get(name)


def _parent(joint: Element) -> str:
    return _attribute(joint, "parent", "link") or ""


def _child(joint: Element) -> str:
    return _attribute(joint, "child", "link") or ""


def _point_inertia(place: np.ndarray) -> np.ndarray:
    """Inertia about the origin of a unit point mass at a place (3,) [m], shape (3, 3) [m^2]."""
    return np.asarray((place @ place) * np.eye(3) - np.outer(place, place))
