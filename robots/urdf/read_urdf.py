"""Read a URDF as a `Robot`, and the visual meshes of its links.

The arm is the chain of revolute joints from the root to the tip. Links attached by fixed joints become part
of the link that carries them, and so do links behind other movable joints, such as a gripper's or a lift's
below the arm, which are held at zero and named in `Robot.held`.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from contactsense.robots.arm_checks import LIGHT, MOST_RADIANS, PLACEHOLDER
from contactsense.robots.errors import RobotError
from contactsense.robots.principal_moments import check_principal_moments
from contactsense.robots.robot import NO_MASS, Inertia, Joint, Link, Robot
from contactsense.robots.tool import join_inertia, move_inertia
from contactsense.robots.urdf.arm_chain import longest_way, way_to
from contactsense.robots.urdf.meshes import check_unit, read_mesh
from contactsense.robots.urdf.urdf_document import MOVING, TURNING, read_document


@dataclass(frozen=True, slots=True)
class Chain:
    """The content of a URDF: its serial arm, and access to its meshes."""

    path: Path
    robot: Robot
    parts: dict[str, list[tuple[str, np.ndarray]]]
    """Link of the arm -> links of the URDF that belong to it, each with its pose (4, 4) in the arm's link."""
    model: Any

    def meshes(self) -> dict[str, trimesh.Trimesh]:
        """Visual surface of each link that has one, in the link's frame [m].

        Raises:
            RobotError: a mesh is missing, unreadable or obviously not in metres.
        """
        found = {}
        for name, parts in self.parts.items():
            pieces = [
                piece.apply_transform(pose)
                for link, pose in parts
                for piece in visuals(self.path, self.model.link_map[link])
            ]
            if pieces:
                found[name] = trimesh.Trimesh(
                    *trimesh.util.append_faces(
                        [piece.vertices for piece in pieces], [piece.faces for piece in pieces]
                    ),
                    process=False,
                )
                check_unit(found[name], f"{self.path}: link {name}")
        return found


def from_urdf(path: str | Path, tip: str | None = None, name: str | None = None) -> Robot:
    """Read an arm from a URDF: kinematics, inertia, limits; its surface is created by `contactsense
    decompose`.

    Args:
        path: The URDF.
        tip: Last link of the arm; by default, the end of the longest chain of revolute joints, without a
            gripper's fingers.
        name: Name of the robot; by default, the one in the URDF.

    Raises:
        RobotError: the file or an element in it cannot be used; the message names both.
    """
    return read_chain(path, tip, name).robot


def read_chain(path: str | Path, tip: str | None = None, name: str | None = None) -> Chain:
    """Read a URDF for its arm and its meshes; see `from_urdf`."""
    path = Path(path)
    model = read_document(path)
    joints = {joint.name: joint for joint in model.joints}
    links = {link.name: link for link in model.links}
    parent = {joint.child: joint for joint in joints.values()}
    root = _root(path, links, model.joints)
    if tip is not None and tip not in links:
        raise RobotError(f"{path}: there is no link {tip}; links are {', '.join(links)}")
    way = way_to(tip, parent) if tip else longest_way(list(links), parent)
    while way and way[0].type not in TURNING:
        way = way[1:]
    for joint in way:
        if joint.type not in (*TURNING, "fixed"):
            raise RobotError(
                f"{path}: joint {joint.name}: expected a revolute, continuous or fixed joint between those "
                f"of the arm, got {joint.type}"
            )
        if joint.mimic is not None:
            raise RobotError(
                f"{path}: joint {joint.name} follows {joint.mimic.joint}: expected an arm whose joints move "
                "by themselves; name its last link as tip"
            )
    turning = [joint for joint in way if joint.type in TURNING]
    if not turning and tip is not None:
        raise RobotError(f"{path}: tip {tip}: expected a link behind a revolute joint, got none before it")
    if not turning:
        raise RobotError(
            f"{path}: no revolute joint; is it a tool? Then contactsense decompose {path} --as-tool"
        )
    held = tuple(joint.name for joint in joints.values() if joint.type in MOVING and joint not in turning)
    _check_held(path, [joints[name] for name in held], {joint.name for joint in turning})
    names = [root, *(joint.child for joint in turning)]
    parts = {link: _rigid(link, joints.values(), {joint.name for joint in turning}) for link in names}
    arm_links = [_link(path, link, parts[link], links) for link in names]
    arm_joints = [_joint(path, joint, parts[names[i]]) for i, joint in enumerate(turning)]
    flange = np.eye(4) if tip is None else dict(parts[names[-1]])[tip]
    robot = Robot(
        name=name or model.name or path.stem,
        links=tuple(arm_links),
        joints=tuple(arm_joints),
        flange_rotation=flange[:3, :3],
        flange_translation=flange[:3, 3],
        file=path,
        tip=tip,
        held=held,
    )
    model.link_map = links
    return Chain(path, robot, parts, model)


def _check_held(path: Path, held: list[Any], arm: set[str]) -> None:
    """Refuse to hold a joint that follows one of the arm's: its links move with the arm."""
    for joint in held:
        if joint.mimic is not None and joint.mimic.joint in arm:
            raise RobotError(
                f"{path}: joint {joint.name}: expected a joint that can be held at zero, but it follows "
                f"{joint.mimic.joint} of the arm"
            )


def read_rigid(path: Path) -> tuple[trimesh.Trimesh, Inertia, tuple[str, ...]]:
    """A URDF as one rigid body: its visual surface and its inertia, in the frame of its root link, and its
    movable joints, which are held at zero.

    Raises:
        RobotError: the file or an element in it cannot be used.
    """
    model = read_document(path)
    links = {link.name: link for link in model.links}
    root = _root(path, links, model.joints)
    model.link_map = links
    parts = {root: _rigid(root, model.joints, set())}
    body = _link(path, root, parts[root], links).inertia
    held = tuple(joint.name for joint in model.joints if joint.type in MOVING)
    meshes = Chain(path, Robot(root, (Link(root, body),), ()), parts, model).meshes()
    if not meshes:
        raise RobotError(f"{path}: no link has a visual shape")
    return meshes[root], body, held


def _root(path: Path, links: dict[str, Any], joints: list[Any]) -> str:
    if not links:
        raise RobotError(f"{path}: expected links, got none")
    carried = {joint.child for joint in joints}
    roots = [link for link in links if link not in carried]
    if len(roots) != 1:
        raise RobotError(f"{path}: expected one root link, got {', '.join(roots) or 'a ring'}")
    for joint in joints:
        if joint.parent == joint.child:
            raise RobotError(f"{path}: joint {joint.name}: expected two links, got {joint.child} twice")
    return roots[0]


def visuals(path: Path, link: Any) -> list[trimesh.Trimesh]:
    """Visual shapes of one link of a URDF, in its frame [m]."""
    pieces, where = [], f"{path}: link {link.name}: visual"
    for visual in link.visuals:
        geometry = visual.geometry
        if geometry.mesh is not None:
            file = find_mesh(path, geometry.mesh.filename)
            piece = read_mesh(file, _scale(f"{where}: mesh", geometry.mesh.scale))
        elif geometry.box is not None:
            piece = trimesh.creation.box(_sizes(f"{where}: box", geometry.box.size, 3))
        elif geometry.cylinder is not None:
            lengths = (geometry.cylinder.radius, geometry.cylinder.length)
            radius, length = _sizes(f"{where}: cylinder", lengths, 2)
            piece = trimesh.creation.cylinder(radius, length, sections=64)
        elif geometry.sphere is not None:
            (radius,) = _sizes(f"{where}: sphere", geometry.sphere.radius, 1)
            piece = trimesh.creation.icosphere(4, radius)
        else:
            raise RobotError(f"{path}: link {link.name}: a visual without shape")
        pieces.append(piece.apply_transform(_pose(visual.origin)))
    return pieces


def _scale(where: str, given: Any) -> np.ndarray | float:
    """The scale of a mesh; refused if it is not one number for each axis."""
    if given is None:
        return 1.0
    scale = np.atleast_1d(np.asarray(given, dtype=np.float64))
    if len(scale) not in (1, 3) or not np.all((scale != 0.0) & np.isfinite(scale)):
        got = " ".join(f"{number:g}" for number in scale)
        raise RobotError(f"{where}: scale: expected 3 numbers other than 0, got {got}")
    return scale


def _sizes(where: str, given: Any, count: int) -> np.ndarray:
    """The sizes of a shape [m]; refused if there are too few, or one that no shape has."""
    sizes = np.atleast_1d(np.asarray(given, dtype=np.float64))
    if len(sizes) != count or not np.all((sizes >= 0.0) & np.isfinite(sizes)):
        wanted = "a size" if count == 1 else f"{count} sizes"
        got = " ".join(f"{size:g}" for size in sizes)
        raise RobotError(f"{where}: expected {wanted} of at least 0 m, got {got}")
    return sizes


def find_mesh(path: Path, name: str) -> Path:
    """Path of a mesh from its name in a URDF: relative to it, absolute, or `package://`, searched upwards.

    A package is a folder of its name in one of the folders above the URDF; where there is none, one of these
    is taken for it, as it may have another name here.

    Raises:
        RobotError: there is no such file.
    """
    if name.startswith("package://"):
        relative = name.removeprefix("package://")
        folders = path.resolve().parents
        for below in (relative, relative.partition("/")[2]):
            for folder in folders:
                if (folder / below).is_file():
                    return folder / below
        raise RobotError(
            f"{path}: mesh {name} is missing: expected {relative} in one of the folders above the URDF"
        )
    if (path.parent / name.removeprefix("file://")).exists():
        return path.parent / name.removeprefix("file://")
    raise RobotError(f"{path}: mesh {name} is missing")


def _rigid(link: str, joints: Any, moving: set[str]) -> list[tuple[str, np.ndarray]]:
    """A link and all links attached to it without a joint of the arm in between, with their poses in it."""
    found = [(link, np.eye(4))]
    for name, pose in found:
        found += [
            (joint.child, pose @ _pose(joint.origin))
            for joint in joints
            if joint.parent == name and joint.name not in moving
        ]
    return found


def _link(path: Path, name: str, parts: list[tuple[str, np.ndarray]], links: dict[str, Any]) -> Link:
    total = NO_MASS
    for part, pose in parts:
        given = links[part].inertial
        if given is None or not given.mass:
            continue
        placed = pose @ _pose(given.origin)
        tensor = np.zeros((3, 3)) if given.inertia is None else np.asarray(given.inertia, dtype=np.float64)
        try:
            own = Inertia(float(given.mass), np.zeros(3), tensor)
        except ValueError as error:
            raise RobotError(f"{path}: link {part}: {error}") from error
        total = join_inertia(total, move_inertia(own, placed[:3, :3], placed[:3, 3]))
    _check_tensor(path, name, total)
    return Link(name, total)


def _check_tensor(path: Path, link: str, body: Inertia) -> None:
    """Refuse an inertia that no body has."""
    if body.mass > LIGHT:
        try:
            check_principal_moments(body.tensor)
        except ValueError as error:
            raise RobotError(f"{path}: link {link}: inertia: {error}") from None


def _joint(path: Path, joint: Any, parts: list[tuple[str, np.ndarray]]) -> Joint:
    pose = dict(parts)[joint.parent] @ _pose(joint.origin)
    axis = np.array([1.0, 0.0, 0.0]) if joint.axis is None else np.asarray(joint.axis, dtype=np.float64)
    length = math.hypot(*axis)
    if not 0.0 < length < math.inf:
        raise RobotError(f"{path}: joint {joint.name}: the axis has no direction: {axis.tolist()}")
    limit = joint.limit
    if joint.type == "revolute" and (limit is None or limit.lower is None or limit.upper is None):
        raise RobotError(f"{path}: joint {joint.name}: a revolute joint needs lower and upper limits")
    if joint.type == "revolute" and not limit.lower <= limit.upper:
        raise RobotError(
            f"{path}: joint {joint.name}: limits: expected lower <= upper, got {limit.lower:g} and "
            f"{limit.upper:g} rad"
        )
    if joint.type == "revolute" and MOST_RADIANS < max(-limit.lower, limit.upper) < PLACEHOLDER:
        raise RobotError(
            f"{path}: joint {joint.name}: limits: expected rad, none above {MOST_RADIANS:.4g}, got "
            f"{limit.lower:g} and {limit.upper:g}; if these are degrees: {np.radians(limit.lower):.4g} and "
            f"{np.radians(limit.upper):.4g}; a joint without limits is continuous"
        )
    for name in ("effort", "velocity") if limit is not None else ():
        # Zero is a placeholder of exporters.
        given = getattr(limit, name)
        if given is not None and not given >= 0.0:
            raise RobotError(
                f"{path}: joint {joint.name}: {name}: expected no negative number, got {given:g}"
            )
    bounds = (float(limit.lower), float(limit.upper)) if joint.type == "revolute" else (-np.inf, np.inf)
    return Joint(
        name=joint.name,
        rotation=pose[:3, :3],
        translation=pose[:3, 3],
        axis=axis / length,
        position_limits=bounds,
        velocity_limit=float(limit.velocity) if limit is not None and limit.velocity else np.inf,
        torque_limit=float(limit.effort) if limit is not None and limit.effort else np.inf,
    )


def _pose(origin: Any) -> np.ndarray:
    return np.eye(4) if origin is None else np.asarray(origin, dtype=np.float64)
