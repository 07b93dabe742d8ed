"""Load the meshes of a robot's links."""

from pathlib import Path

import numpy as np
import trimesh
from trimesh.units import unit_conversion

from contactsense.robots.errors import RobotError
from contactsense.robots.files.suffixes import MESH_SUFFIXES


def read_mesh(path: Path, scale: float | np.ndarray = 1.0) -> trimesh.Trimesh:
    """Load all meshes of a file as one, scaled.

    The length unit of a COLLADA file is taken into account, as in RViz; other formats name none.

    Raises:
        RobotError: the file is missing, has an unknown format, or contains no surface.
    """
    if not path.exists():
        raise RobotError(f"{path}: no such mesh")
    try:
        loaded = trimesh.load(path, force="mesh", process=False)
    except Exception as error:  # the parsers of five formats raise whatever they stumble over
        reason = " ".join(str(error).split()) or type(error).__name__
        raise RobotError(f"{path}: not readable as a mesh: {reason}") from error
    if not isinstance(loaded, trimesh.Trimesh) or len(loaded.faces) == 0:
        raise RobotError(f"{path}: holds no surface")
    if path.suffix.lower() == ".dae":
        scale = np.multiply(scale, unit_conversion(loaded.units or "meters", "meters"))
    loaded.apply_transform(np.diag([*np.broadcast_to(scale, 3), 1.0]))
    if not np.all(np.isfinite(loaded.vertices)) or not loaded.area > 0.0:
        raise RobotError(f"{path}: zero size, or numbers that are not finite")
    return loaded


def check_unit(mesh: trimesh.Trimesh, where: str, remedy: str = "set the mesh's scale") -> None:
    """Reject meshes that are obviously not in metres.

    Raises:
        RobotError: larger than 5 m or smaller than 5 mm.
    """
    extent = float(np.linalg.norm(mesh.extents))
    if extent <= 0.005:
        raise RobotError(f"{where}: {extent:.3g} m across: in metres already? Then leave out its scale")
    if not extent < 5.0:
        raise RobotError(f"{where}: {extent:.3g} m across: not in metres? Then {remedy}")


def from_folder(folder: Path, names: tuple[str, ...]) -> dict[str, trimesh.Trimesh]:
    """Meshes named after the links, each in its link's frame, in metres.

    Args:
        folder: Contains `<link>.ply`, or a file with another of `MESH_SUFFIXES`, also in capitals.
        names: The links, all of which are needed.

    Raises:
        RobotError: the folder or a file is missing or unusable.
    """
    if not folder.is_dir():
        raise RobotError(f"{folder}: no such folder of meshes")
    meshes = {}
    for name in names:
        found = _files(folder / name)
        if not found:
            raise RobotError(
                f"{folder}: no mesh for link {name} ({name}.ply, or one of {', '.join(MESH_SUFFIXES[1:])})"
            )
        meshes[name] = read_mesh(found[0])
        check_unit(meshes[name], str(found[0]))
    return meshes


def _files(place: Path) -> list[Path]:
    """Files of a mesh, given without the ending, in the order of `MESH_SUFFIXES`; of the same ending, that in
    lower case first."""
    beside = sorted(place.parent.glob("*"), reverse=True)
    found = [path for path in beside if path.stem == place.name and path.suffix.lower() in MESH_SUFFIXES]
    return sorted(found, key=lambda path: MESH_SUFFIXES.index(path.suffix.lower()))
