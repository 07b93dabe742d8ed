"""The links that a scene does not search: their surfaces in short."""

from typing import NamedTuple

import numpy as np

from contactsense.localization.surface.surface_moments import SurfaceMoments, moments_of_points
from contactsense.localization.surface.surface_samples import surface_patches
from contactsense.scene import Scene
from contactsense.scene_model.scene_surfaces import scene_surfaces, touchable_links


class UnsearchedSurfaces(NamedTuple):
    """Surfaces of the links that are not searched; zero for those that are."""

    area: np.ndarray
    """Shape (links,) [m^2]."""
    centre: np.ndarray
    """Mean of the surface's points, link frame, shape (links, 3) [m]."""
    covariance: np.ndarray
    """Their covariance, link axes, shape (links, 3, 3) [m^2]."""


def unsearched_surfaces(scene: Scene) -> UnsearchedSurfaces:
    """Area, centre and covariance of the links that `Scene.touchable` or a weight of 0 leaves out."""
    names, searched = scene.link_names, touchable_links(scene)
    area, centre, covariance = np.zeros(len(names)), np.zeros((len(names), 3)), np.zeros((len(names), 3, 3))
    surfaces = scene_surfaces(scene, [name for name, one in zip(names, searched, strict=True) if not one])
    for link in np.flatnonzero(searched == 0):
        patches = surface_patches(surfaces, int(link))
        area[link] = patches.area.sum()
        if area[link] > 0.0:
            centre[link], covariance[link] = moments_of_points(patches.area, patches.point)
    return UnsearchedSurfaces(area, centre, covariance)


def left_out_links(scene: Scene, surfaces: UnsearchedSurfaces, searched_area: float) -> SurfaceMoments:
    """The links that are not in `Scene.touchable`, with their weights.

    With `link_prior: equal` each is as probable as a touchable link; otherwise its surface counts as much as
    theirs, by area. A link of weight 0 cannot be touched.

    Args:
        scene: The scene.
        surfaces: Those of its links that are not searched.
        searched_area: Area of the surface that is searched [m^2].
    """
    searched = touchable_links(scene)
    log_weight = np.full(len(searched), -np.inf)
    for link, name in enumerate(scene.link_names):
        if scene.touchable is None or name in scene.touchable or surfaces.area[link] == 0.0:
            continue
        equal = scene.link_prior == "equal" and searched.any()
        log_weight[link] = -np.log(searched.sum()) if equal else np.log(surfaces.area[link] / searched_area)
    return SurfaceMoments(log_weight, surfaces.centre, surfaces.covariance)
