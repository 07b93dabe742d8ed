"""The places of a scene's surface that its primitives do not model."""

import numpy as np

from contactsense.localization.surface.surface_moments import SurfaceMoments, moments_of_points
from contactsense.localization.surface.surface_samples import SurfaceSamples
from contactsense.robots.surface.convex_primitives import Surfaces

SHARE_PER_SQUARED_TILT = 0.2
"""Share of unmodelled places in a cell per variance of its tilt along each tangent [1/rad^2].

That variance is mostly due to a few steep places. With 0.5 it would be the share of contacts with a force at
75 degrees or more from the primitive's inward normal; at some of them the primitives explain the contact
nevertheless, a little farther off. From 0.05 to 0.4 the log scores of `contactsense bench calibration --json`
differ little on ground truth that was made for tuning (UR3e and UR5e, `--seed 11`)."""


def unmodelled_places(
    surfaces: Surfaces, samples: SurfaceSamples, log_link_density: np.ndarray
) -> SurfaceMoments:
    """Probability, mean and covariance of the unmodelled places on each link.

    Args:
        surfaces: Primitives.
        samples: Samples of their surface, with the tilt of each.
        log_link_density: Log of the factor on the prior density of places on each link, shape (links,).
    """
    links = len(log_link_density)
    owner = surfaces.link[samples.primitive]
    weight = np.exp(samples.log_share) * SHARE_PER_SQUARED_TILT * samples.tilt**2
    log_weight, mean, covariance = np.full(links, -np.inf), np.zeros((links, 3)), np.zeros((links, 3, 3))
    for link in range(links):
        rows = owner == link
        total = weight[rows].sum()
        if total > 0.0:
            log_weight[link] = np.log(total) + log_link_density[link]
            mean[link], covariance[link] = moments_of_points(weight[rows], samples.point[rows])
    return SurfaceMoments(log_weight, mean, covariance)
