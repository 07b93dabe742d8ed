"""The surfaces of a scene for the kernels: arm, tool, and the bodies that cover them or stand on the base
sensor."""

from collections.abc import Collection, Iterable

import numpy as np

from contactsense.robots import Link
from contactsense.robots.surface.convex_primitives import Surfaces, pack
from contactsense.robots.surroundings import Body, pack_bodies
from contactsense.scene import Scene


def scene_surfaces(scene: Scene, shown: Collection[str] | None = None) -> Surfaces:
    """Primitives of the links in `shown`, all touchable ones if None, at the scene's level of detail; other
    links have none.

    Those of pedestals follow the base link's own, as they are rigidly joined to it. Those of covers, in the
    base frame, follow the last link's: they belong to no link, so that no contact is searched on them.
    """
    names = scene.touchable_links if shown is None else shown
    links = list(scene.robot.links)
    if len(scene.link_names) > len(links):
        assert scene.tool is not None
        links.append(Link(scene.tool.name, scene.tool.inertia, scene.tool.primitives))
    surfaces = pack([_at_detail(link, link.name in names, scene.detail) for link in links])
    if len(links) > len(scene.robot.links):
        first = surfaces.start[-2]
        R, o = scene.robot.flange_rotation, scene.robot.flange_translation
        surfaces.rotation[first:] = R @ surfaces.rotation[first:]
        surfaces.origin[first:] = surfaces.origin[first:] @ R.T + o
    surfaces = with_pedestals(surfaces, scene.bodies)
    covers = pack_bodies(body for body in scene.bodies if body.role == "cover")
    return _inserted(surfaces, len(surfaces.kind), covers)


def with_pedestals(surfaces: Surfaces, bodies: Iterable[Body]) -> Surfaces:
    """Surfaces of links with the pedestals among some bodies after the base link's own primitives."""
    pedestals = pack_bodies(body for body in bodies if body.role == "pedestal")
    joined = _inserted(surfaces, int(surfaces.start[1]), pedestals)
    start = surfaces.start.copy()
    start[1:] += len(pedestals.kind)
    return joined._replace(start=start)


def touchable_links(scene: Scene) -> np.ndarray:
    """1 for links that can be touched, else 0, shape (links,), int64; a pedestal is part of the base link."""
    touchable = {*scene.touchable_links}
    base, weights = scene.link_names[0], {} if isinstance(scene.link_prior, str) else scene.link_prior
    if any(body.role == "pedestal" for body in scene.bodies) and weights.get(base, 1.0) > 0.0:
        touchable.add(base)
    return np.array([name in touchable for name in scene.link_names], dtype=np.int64)


def _at_detail(link: Link, shown: bool, detail: str) -> Link:
    if not shown:
        return Link(link.name, link.inertia)
    if detail == "coarse" and link.coarse:
        return Link(link.name, link.inertia, link.coarse)
    return link


def _inserted(surfaces: Surfaces, index: int, added: Surfaces) -> Surfaces:
    """Surfaces with further primitives before number `index`; `start` stays as it is."""
    joined = {
        name: np.concatenate((old[:index], getattr(added, name), old[index:]))
        for name, old in surfaces._asdict().items()
        if name != "start"
    }
    return surfaces._replace(**joined)
