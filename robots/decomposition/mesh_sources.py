"""Find an arm and its meshes by a name given by the user."""

from pathlib import Path

import airo_models
import trimesh

from contactsense import robots
from contactsense.robots import Robot, RobotError
from contactsense.robots.decomposition.grid_builder import cached
from contactsense.robots.meshes import from_folder
from contactsense.robots.surface.signed_distance_grid import Grids
from contactsense.robots.urdf import read_chain, visuals

_AIRO_LINKS = {"base": "base_link_inertia"}
"""Links of PyPI's airo-models whose names differ from ours by more than a suffix."""


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
    if Path(arm).suffix in (".urdf", ".xml"):
        chain = read_chain(arm, tip)
        meshes = chain.meshes() if folder is None else from_folder(folder, chain.robot.link_names)
        if not meshes:
            raise RobotError(f"{arm}: no link has a visual shape")
        return chain.robot, meshes
    robot = robots.load(arm)
    if folder is not None:
        return robot, from_folder(folder, robot.link_names)
    if robot.name not in airo_models.AIRO_MODEL_NAMES:
        raise RobotError(f"{robot.name}: no meshes known; name a folder of them with --meshes")
    return robot, _from_airo(robot)


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


def skin_grids(arm: str, folder: Path | None = None, cache: Path | None = None) -> Grids:
    """Signed-distance grids of an arm's skin, from the cache or built now (about a minute per arm).

    Args:
        arm: As in `read_arm`.
        folder: Folder of the meshes, as in `read_arm`.
        cache: Folder for the grids; by default `contactsense` in `XDG_CACHE_HOME` or `~/.cache`.

    Raises:
        RobotError: robot or meshes are missing or unusable, or the cache cannot be written.
    """
    robot, meshes = read_arm(arm, folder)
    return cached(robot, meshes, cache)
