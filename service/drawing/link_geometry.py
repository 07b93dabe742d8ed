"""What is drawn of each link: triangle meshes in the link's frame."""

from typing import NamedTuple

import numpy as np

from contactsense.robots import Link
from contactsense.robots.surface.convex_primitives import Surfaces, pack
from contactsense.scene import Scene
from contactsense.service.drawing.mesh import Mesh
from contactsense.service.drawing.primitive_meshes import outer_triangles, surface_mesh

__all__ = ["LinkGeometry", "Mesh", "geometry_of", "link_meshes"]

_RECENT = 4
"""Number of scenes whose geometry is kept."""
_recent: "list[tuple[Scene, LinkGeometry]]" = []


class LinkGeometry(NamedTuple):
    """The primitives of `scene.link_names`, each in its link's frame; a tool's in the flange's frame."""

    surfaces: Surfaces
    """The primitives of all links."""
    meshes: tuple[Mesh, ...]
    """Their mesh for each link."""
    triangles: tuple[np.ndarray, ...]
    """The triangles of each link that lie on its surface, link frame, shape (T, 3, 3) [m]."""


def link_meshes(scene: Scene, visual: bool = False) -> tuple[Mesh, ...]:
    """One mesh for each of `scene.link_names`, in the link's frame; a tool's in the flange's frame.

    Args:
        scene: The scene.
        visual: Show the arm's visual meshes where there are any; otherwise, and for the other links, the
            primitives.

    Raises:
        ImportError: `visual` needs the packages of the extra `geometry`.
    """
    meshes = {}
    if visual:
        from contactsense.service.drawing.visual_meshes import visual_meshes

        meshes = visual_meshes(scene)
    primitives = geometry_of(scene).meshes
    return tuple(meshes.get(name, primitives[link]) for link, name in enumerate(scene.link_names))


def geometry_of(scene: Scene) -> LinkGeometry:
    """Primitives of a scene and their meshes; computed once for each scene."""
    for known, geometry in _recent:
        if known is scene:
            return geometry
    links = list(scene.robot.links)
    if len(scene.link_names) > len(links) and scene.tool is not None:
        links.append(Link(scene.tool.name, scene.tool.inertia, scene.tool.primitives))
    surfaces = pack(links)
    meshes = tuple(surface_mesh(surfaces, link) for link in range(len(links)))
    outer = tuple(outer_triangles(surfaces, link, mesh) for link, mesh in enumerate(meshes))
    geometry = LinkGeometry(surfaces, meshes, outer)
    _recent.insert(0, (scene, geometry))
    del _recent[_RECENT:]
    return geometry
