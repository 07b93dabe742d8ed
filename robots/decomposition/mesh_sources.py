"""Find an arm and its meshes by a name given by the user."""

from pathlib import Path

import airo_models
import numpy as np
import trimesh
from scipy.spatial import cKDTree

from contactsense import robots
from contactsense.robots import Joint, Link, Robot, RobotError
from contactsense.robots.decomposition.grid_builder import cached
from contactsense.robots.files.suffixes import MESH_SUFFIXES, URDF_SUFFIXES
from contactsense.robots.library import in_library
from contactsense.robots.robot import NO_MASS
from contactsense.robots.surface.signed_distance_grid import Grids
from contactsense.robots.urdf.meshes import check_unit, from_folder, read_mesh
from contactsense.robots.urdf.read_urdf import Chain, read_chain, read_rigid, visuals

_AIRO_LINKS = {"base": "base_link_inertia"}
"""Links of PyPI's airo-models whose names differ from ours by more than a suffix."""

_FAR = 0.01
"""Nine in ten places of a link's surface are nearer to its mesh than this and twice their own deviation [m].
They are means over cells of 40 mm, so up to 5 mm below a curved surface."""

_SPACING = 0.004
"""The samples on a mesh that are compared with them are about so far apart [m]."""


def read_arm(
    arm: str, folder: Path | None, tip: str | None = None
) -> tuple[Robot, dict[str, trimesh.Trimesh]]:
    """An arm and the visual mesh of each of its links, in the link's frame [m].

    Args:
        arm: Path to a .urdf, or a name or .yaml file for `robots.load`.
        folder: Folder of the meshes; by default those of the URDF, or of PyPI's airo-models (MIT), which
            contains UR3e and UR5e.
        tip: Last link of the arm in a URDF.

    Raises:
        RobotError: robot or meshes are missing or unusable.
    """
    if Path(arm).suffix.lower() in URDF_SUFFIXES:
        chain = read_chain(arm, tip)
        return chain.robot, _of_chain(chain, folder)
    robot = robots.load(arm)
    if tip is not None and tip != robot.link_names[-1]:
        raise RobotError(
            f"tip: {arm} ends at {robot.link_names[-1]}; only a URDF may end elsewhere, got {tip}"
        )
    return robot, meshes_of(robot, folder)


def read_tool(path: Path, scale: float = 1.0) -> tuple[Robot, dict[str, trimesh.Trimesh]]:
    """A tool or a body of the cell, and its mesh, as the last link of a robot whose other link has none.

    Args:
        path: A mesh, or a URDF; a tool's root link is at the flange, movable joints are held at zero.
        scale: Of a mesh: metres per unit.

    Raises:
        RobotError: the file is missing or unusable.
    """
    held: tuple[str, ...] = ()
    if path.suffix.lower() in MESH_SUFFIXES:
        mesh, body = read_mesh(path, scale), NO_MASS
        check_unit(mesh, str(path), "use --scale 0.001 for millimetres")
    elif path.suffix.lower() in URDF_SUFFIXES:
        if scale != 1.0:
            raise RobotError(f"{path}: a URDF has its own scale; expected no other, got {scale:g}")
        mesh, body, held = read_rigid(path)
    else:
        raise RobotError(
            f"{path}: expected a mesh ({', '.join(MESH_SUFFIXES)}) or a URDF for a tool or a body, "
            f"got {path.suffix!r}"
        )
    joint = Joint("flange", np.eye(3), np.zeros(3), np.array([0.0, 0.0, 1.0]), (0.0, 0.0), np.inf, np.inf)
    links = (Link("flange", NO_MASS), Link("tool", body))
    return Robot(path.stem, links, (joint,), file=path, held=held), {"tool": mesh}


def meshes_of(robot: Robot, folder: Path | None = None) -> dict[str, trimesh.Trimesh]:
    """The visual mesh of each link, in the link's frame [m].

    They are found by the file that the robot was read from, never by its name: another robot of the same name
    has other links.

    Args:
        robot: The arm.
        folder: Folder of the meshes; by default those of its URDF, or of PyPI's airo-models (MIT), which
            contains UR3e and UR5e.

    Raises:
        RobotError: meshes are missing or unusable.
    """
    if folder is not None:
        return from_folder(folder, robot.link_names)
    if robot.file is not None and robot.file.suffix.lower() != ".yaml":
        return _of_chain(read_chain(robot.file, robot.tip), None)
    if not in_library(robot) or robot.name not in airo_models.AIRO_MODEL_NAMES:
        raise RobotError(
            f"{robot.name}: no meshes known; name a folder of them (--meshes, or `meshes` of a scene)"
        )
    return _from_airo(robot)


def _of_chain(chain: Chain, folder: Path | None) -> dict[str, trimesh.Trimesh]:
    meshes = chain.meshes() if folder is None else from_folder(folder, chain.robot.link_names)
    if not meshes:
        raise RobotError(f"{chain.path}: no link has a visual shape; --meshes names a folder of meshes")
    return meshes


def _from_airo(robot: Robot) -> dict[str, trimesh.Trimesh]:
    path = Path(airo_models.get_urdf_path(robot.name))
    model = read_chain(path).model
    meshes = {}
    for name in robot.link_names:
        link = model.link_map[_AIRO_LINKS.get(name, f"{name}_link")]
        if name == "base":
            # That URDF includes the base's cable, which is not part of the arm.
            link.visuals[0].geometry.mesh.filename = "visual/base.obj"
        meshes[name] = visuals(path, link)[0]
    return meshes


def skin_meshes(robot: Robot, folder: Path | None = None) -> dict[str, trimesh.Trimesh]:
    """As `meshes_of`, for the skin on the robot's own primitives.

    Raises:
        RobotError: meshes are missing or unusable, or are not those that the primitives were fitted to, as
            those of another arm with the same names of links.
    """
    meshes = meshes_of(robot, folder)
    for link in robot.links:
        if link.name not in meshes or not link.deviation:
            continue
        mesh = meshes[link.name]
        points, _ = trimesh.sample.sample_surface(mesh, 1 + int(mesh.area / _SPACING**2), seed=0)
        distance, _ = cKDTree(points).query(np.array([place.point for place in link.deviation]))
        off = float(np.quantile(distance, 0.9))
        stated = float(np.quantile([place.offset for place in link.deviation], 0.9))
        if off > _FAR + 2.0 * stated:
            raise RobotError(
                f"{link.name}: expected the mesh to which the primitives of {robot.name} were fitted, in the "
                f"link's frame, got one that is {1e3 * off:.0f} mm and more from a tenth of their surface; "
                "is it that of another arm?"
            )
    return meshes


def skin_grids(robot: Robot, folder: Path | None = None, cache: Path | None = None) -> Grids:
    """Signed-distance grids of an arm's skin, from the cache or built now (about a minute per arm).

    Args:
        robot: The arm.
        folder: Folder of the meshes, as in `meshes_of`.
        cache: Folder for the grids; by default `contactsense` in `XDG_CACHE_HOME` or `~/.cache`.

    Raises:
        RobotError: meshes are missing, unusable or of another arm, or the cache cannot be written.
    """
    return cached(robot, skin_meshes(robot, folder), cache)
