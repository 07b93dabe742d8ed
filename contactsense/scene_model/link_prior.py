"""The prior over links: how probable a contact on each link is before any measurement."""

import numpy as np

from contactsense.localization.surface.surface_samples import SurfaceSamples
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.scene import Scene


def area_share(surfaces: Surfaces, samples: SurfaceSamples, links: int) -> np.ndarray:
    """Share of each link in the touchable surface, shape (links,); a pedestal counts with the base link."""
    return np.bincount(surfaces.link[samples.primitive], np.exp(samples.log_share), minlength=links)


def link_probability(scene: Scene, share: np.ndarray) -> np.ndarray:
    """Prior probability of each link under the scene's `link_prior`, shape (links,).

    Args:
        scene: The scene.
        share: `area_share`; a link without touchable surface has probability 0.
    """
    if scene.link_prior == "area":
        return share
    weight = np.ones(len(share))
    if not isinstance(scene.link_prior, str):
        weight = np.array([scene.link_prior.get(name, 0.0) for name in scene.link_names])
    weight = np.where(share > 0.0, weight, 0.0)
    return np.asarray(weight / weight.sum()) if weight.any() else weight


def log_link_density(scene: Scene, share: np.ndarray) -> np.ndarray:
    """Log of the density of places on each link relative to that of places uniform by area, shape (links,).

    A place on a link has the link's probability over its area for a density. Uniform by area, that is 1 over
    the area of all links; so the ratio is probability over share. The logarithm is 0 where no place can be
    touched.

    Args:
        scene: The scene.
        share: `area_share`.
    """
    found = np.zeros(len(share))
    if scene.link_prior != "area":
        probability = link_probability(scene, share)
        touched = probability > 0.0
        found[touched] = np.log(probability[touched] / share[touched])
    return found
