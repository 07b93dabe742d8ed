"""The visual meshes of an arm, with few enough triangles to be drawn thirty times a second."""

import numpy as np

from contactsense.robots import RobotError
from contactsense.scene import Scene
from contactsense.service.drawing.mesh import Mesh

MOST_TRIANGLES = 55_000
"""Of an arm; larger meshes are simplified."""


def visual_meshes(scene: Scene) -> dict[str, Mesh]:
    """Visual meshes by link, in the link's frame; empty where none are known.

    They are found as `contactsense.robots.decomposition.mesh_sources.meshes_of` finds them: in the scene's
    folder `meshes`, in the URDF of the arm, or in the package airo-models.

    Raises:
        ImportError: the packages of the extra `geometry` are missing.
    """
    from contactsense.robots.decomposition.mesh_sources import meshes_of

    try:
        found = meshes_of(scene.robot, scene.meshes)
    except RobotError:
        return {}
    # Files of meshes list a vertex once for each of its normals; simplification needs to know its neighbours.
    for mesh in found.values():
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
    total = sum(len(mesh.faces) for mesh in found.values())
    meshes = {}
    for name, mesh in found.items():
        if total > MOST_TRIANGLES:
            mesh = mesh.simplify_quadric_decimation(percent=1.0 - MOST_TRIANGLES / total)
        meshes[name] = Mesh(np.array(mesh.vertices, dtype=np.float64), np.array(mesh.faces, dtype=np.int64))
    return meshes
