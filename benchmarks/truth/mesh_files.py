"""The visual meshes of an arm's links as files, for the benchmarks that compare with the real surface."""

from pathlib import Path

import trimesh

from .arm import Arm


def write(folder: Path, arm: Arm) -> None:
    """One `LINK.ply` for each link that has a shape, in the link's frame [m].

    Raises:
        OSError: a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for link in arm.links:
        if not len(link.faces):
            continue
        mesh = trimesh.Trimesh(link.vertices, link.faces, process=False)
        mesh.export(folder / f"{link.name}.ply")
