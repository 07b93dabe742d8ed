"""The links that a scene leaves out although they can be touched: their surfaces in short."""

import numpy as np

from contactsense.localization.none_of_these import LeftOutLinks
from contactsense.localization.surface_samples import surface_patches
from contactsense.runtime.scene_surfaces import scene_surfaces, touchable_links
from contactsense.scene import Scene


def left_out_links(scene: Scene, area: float) -> LeftOutLinks:
    """Weight, centre and covariance of the links that are not in `Scene.touchable`.

    With `link_prior: equal` each is as probable as a touchable link; otherwise its surface counts as much as
    theirs, by area. A link of weight 0 cannot be touched.

    Args:
        scene: The scene.
        area: Area of the surface that is searched [m^2].
    """
    names, searched = scene.link_names, touchable_links(scene)
    log_weight = np.full(len(names), -np.inf)
    centre, covariance = np.zeros((len(names), 3)), np.zeros((len(names), 3, 3))
    left_out = [] if scene.touchable is None else [name for name in names if name not in scene.touchable]
    surfaces = scene_surfaces(scene, left_out)
    for link, name in enumerate(names):
        if name not in left_out or searched[link]:
            continue
        patches = surface_patches(surfaces, link)
        total = float(patches.area.sum())
        if total == 0.0:
            continue
        centre[link] = patches.area @ patches.point / total
        offset = patches.point - centre[link]
        covariance[link] = (patches.area[:, None] * offset).T @ offset / total
        equal = scene.link_prior == "equal" and searched.any()
        log_weight[link] = -np.log(searched.sum()) if equal else np.log(total / area)
    return LeftOutLinks(log_weight, centre, covariance)
