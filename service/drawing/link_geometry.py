"""What is drawn of each link and of each body of the cell: triangle meshes."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from contactsense.robots import Inertia, Link
from contactsense.robots.primitives import Primitive
from contactsense.robots.surface.convex_primitives import Surfaces, pack
from contactsense.robots.surroundings import pack_bodies
from contactsense.scene import Scene
from contactsense.scene_model.scene_surfaces import with_pedestals
from contactsense.service.drawing.mesh import Mesh
from contactsense.service.drawing.primitive_meshes import outer_triangles, surface_mesh

__all__ = ["LinkGeometry", "Mesh", "body_meshes", "geometry_of", "link_meshes"]

_RECENT = 4
"""Number of scenes whose geometry is kept."""
_recent: "list[tuple[Scene, LinkGeometry]]" = []


class LinkGeometry(NamedTuple):
    """The primitives of `scene.link_names`, each in its link's frame; a tool's in the flange's frame.

    Pedestals are part of the base link's surface, as contacts on them are contacts of that link; its mesh is
    without them.
    """

    surfaces: Surfaces
    """The primitives of all links, pedestals after those of the base link."""
    meshes: tuple[Mesh, ...]
    """Their mesh for each link."""
    triangles: tuple[np.ndarray, ...]
    """The triangles of each link that lie on its surface, pedestals included, link frame, shape (T, 3, 3)
    [m]."""


def link_meshes(scene: Scene, visual: bool = False, pedestals: bool = False) -> tuple[Mesh, ...]:
    """One mesh for each of `scene.link_names`, in the link's frame; a tool's in the flange's frame.

    Args:
        scene: The scene.
        visual: Show the arm's visual meshes where there are any; otherwise, and for the other links, the
            primitives.
        pedestals: Add the scene's pedestals to the base link's mesh.

    Raises:
        ImportError: `visual` needs the packages of the extra `geometry`.
    """
    meshes = {}
    if visual:
        from contactsense.service.drawing.visual_meshes import visual_meshes

        meshes = visual_meshes(scene)
    primitives = geometry_of(scene).meshes
    found = [meshes.get(name, primitives[link]) for link, name in enumerate(scene.link_names)]
    if pedestals:
        bodies = zip(body_meshes(scene), scene.bodies, strict=True)
        found[0] = Mesh.joined([found[0], *(mesh for mesh, body in bodies if body.role == "pedestal")])
    return tuple(found)


def body_meshes(scene: Scene) -> tuple[Mesh, ...]:
    """One mesh for each of `scene.bodies`, in the base frame."""
    return tuple(surface_mesh(pack_bodies([body]), 0) for body in scene.bodies)


def geometry_of(scene: Scene) -> LinkGeometry:
    """Primitives of a scene and their meshes; computed once for each scene."""
    for known, geometry in _recent:
        if known is scene:
            return geometry
    links = list(scene.robot.links)
    if len(scene.link_names) > len(links) and scene.tool is not None:
        links.append(Link(scene.tool.name, scene.tool.inertia, scene.tool.primitives))
    meshes, outer = zip(*(_drawn(link.primitives) for link in links), strict=True)
    surfaces = with_pedestals(pack(links), scene.bodies)
    if len(surfaces.kind) > sum(len(link.primitives) for link in links):
        base = outer_triangles(surfaces, 0, surface_mesh(surfaces, 0))
        outer = (base, *outer[1:])
    geometry = LinkGeometry(surfaces, meshes, outer)
    _recent.insert(0, (scene, geometry))
    del _recent[_RECENT:]
    return geometry


@lru_cache(maxsize=64)
def _drawn(primitives: tuple[Primitive, ...]) -> tuple[Mesh, np.ndarray]:
    """Mesh and outer triangles of one link: most scenes of a cell have the same arm."""
    surfaces = pack([Link("", Inertia(0.0, np.zeros(3), np.zeros((3, 3))), primitives)])
    mesh = surface_mesh(surfaces, 0)
    return mesh, outer_triangles(surfaces, 0, mesh)
