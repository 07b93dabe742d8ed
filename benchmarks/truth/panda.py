"""The Panda with its hand: frames, limits, inertia and visual meshes of `example-robot-data`.

Links 0 to 7 are `panda_link0` to `panda_link7`. The last one carries hand and fingers, which are closed.
"""

from importlib import metadata
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from .arm import Arm, Link
from .urdf import limits, mesh, pose, symmetric

_PACKAGE = "example-robot-data"
_JOINTS = 7


class _Body:
    """Rigidly connected parts of the URDF, in the frame of the first one."""

    def __init__(self) -> None:
        self.vertices, self.faces = np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
        self.mass, self.moment, self.tensor = 0.0, np.zeros(3), np.zeros((3, 3))

    def add(self, part: ElementTree.Element, where: tuple[np.ndarray, np.ndarray], meshes: Path) -> None:
        """Add a link of the URDF.

        Args:
            part: The link.
            where: Its origin (3,) [m] and rotation (3, 3) in the frame of the body.
            meshes: Folder that the names of its meshes begin in.
        """
        origin, rotation = where
        for visual in part.findall("visual"):
            shift, turn = pose(visual)
            name = visual.find("geometry/mesh").attrib["filename"]  # type: ignore[union-attr]
            vertices, faces = mesh(meshes / name.removeprefix("package://"))
            self.faces = np.concatenate((self.faces, faces + len(self.vertices)))
            self.vertices = np.concatenate((self.vertices, (vertices @ turn.T + shift) @ rotation.T + origin))
        inertial = part.find("inertial")
        assert inertial is not None
        shift, turn = pose(inertial)
        mass = float(inertial.find("mass").attrib["value"])  # type: ignore[union-attr]
        values = inertial.find("inertia").attrib  # type: ignore[union-attr]
        own = symmetric(*(float(values[f"i{axes}"]) for axes in ("xx", "xy", "xz", "yy", "yz", "zz")))
        com, turn = origin + rotation @ shift, rotation @ turn
        self.mass += mass
        self.moment += mass * com
        self.tensor += turn @ own @ turn.T + mass * _point_inertia(com)

    def link(self, name: str, where: tuple[np.ndarray, np.ndarray]) -> Link:
        """The body as a link, whose joint has an origin and a rotation in the link before."""
        com = self.moment / self.mass
        tensor = self.tensor - self.mass * _point_inertia(com)
        return Link(name, *where, self.vertices, self.faces, self.mass, com, tensor)


def read(name: str) -> Arm:
    """The arm.

    Raises:
        ImportError: the package is not installed.
        ValueError: a mesh has no facets.
    """
    path = _urdf()
    urdf = ElementTree.parse(path).getroot()
    # The names of meshes begin with that of the package, above the folder of all robots.
    meshes = path.parents[4]
    held = {"panda_hand": _placed(urdf, "panda_joint8", "panda_hand_joint")}
    for side, finger in (("left", 1), ("right", 2)):
        joints = ("panda_joint8", "panda_hand_joint", f"panda_finger_joint{finger}")
        held[f"panda_{side}finger"] = _placed(urdf, *joints)
    here = (np.zeros(3), np.eye(3))
    joints_of_arm = [_find(urdf, "joint", f"panda_joint{j}") for j in range(1, _JOINTS + 1)]
    links = []
    for number, where in enumerate([here, *(pose(joint) for joint in joints_of_arm)]):
        body, link = _Body(), f"panda_link{number}"
        parts = {link: here, **(held if number == _JOINTS else {})}
        for part, place in parts.items():
            body.add(_find(urdf, "link", part), place, meshes)
        links.append(body.link(link, where))
    return Arm(name, tuple(links), *limits(joints_of_arm), _PACKAGE)


def _urdf() -> Path:
    try:
        files = metadata.files(_PACKAGE) or []
    except metadata.PackageNotFoundError:
        raise ImportError(f"{_PACKAGE} cannot be imported; install contactsense[panda]") from None
    return next(Path(str(file.locate())) for file in files if file.name == "panda.urdf").resolve()


def _find(urdf: ElementTree.Element, kind: str, name: str) -> ElementTree.Element:
    found = urdf.find(f"{kind}[@name='{name}']")
    assert found is not None, name
    return found


def _placed(urdf: ElementTree.Element, *joints: str) -> tuple[np.ndarray, np.ndarray]:
    """Origin and rotation of the link behind a chain of joints at zero, in the link before them."""
    origin, rotation = np.zeros(3), np.eye(3)
    for joint in joints:
        shift, turn = pose(_find(urdf, "joint", joint))
        origin, rotation = origin + rotation @ shift, rotation @ turn
    return origin, rotation


def _point_inertia(place: np.ndarray) -> np.ndarray:
    """Inertia about the origin of a unit point mass at a place (3,) [m], shape (3, 3) [m^2]."""
    return np.asarray((place @ place) * np.eye(3) - np.outer(place, place))
