"""Smoothed places on the links' skin, for scenes with `detail: skin`.

The smoother works with primitives, and the covariance C of its place says how the place shifts if the surface
lies higher: along C n, n being the normal, which is nearly the line of action. The place moves along that
direction to the skin, and its covariance is the one given the height there. The primitive's normal is used
for it, as that of the skin varies from one detail to the next within the region of the place.
"""

from dataclasses import replace

import numpy as np

from contactsense.robots.surface.signed_distance_grid import Grids, intersect_skin
from contactsense.robots.vectors import vector
from contactsense.runtime.candidate_rows import SKIN_STEPS, SKIN_TOLERANCE
from contactsense.service.analysis.smoothing.place_search import Place

SKIN_DEVIATION = 2e-4
"""Standard deviation of the real surface from the skin [m]."""


def place_on_skin(grids: Grids, place: Place) -> Place:
    """The place and its covariance, given that it is on the skin; windows for which none is found keep
    theirs."""
    if place.link >= len(grids.shape):
        return place
    point, normal, covariance = place.point.copy(), place.normal.copy(), place.covariance.copy()
    for w in range(len(point)):
        # A fixed place is the same in all windows.
        if w > 0 and not place.sliding and np.array_equal(place.point[w], place.point[0]):
            point[w], normal[w], covariance[w] = point[0], normal[0], covariance[0]
            continue
        shift = covariance[w] @ normal[w]
        variance = float(normal[w] @ shift)
        shift /= variance
        distance, on_skin, outward = intersect_skin(
            grids, place.link, vector(point[w]), vector(shift), SKIN_STEPS
        )
        # At ribs and edges the direction may lead into the link at the nearest skin: the force pulls there.
        if abs(distance) < SKIN_TOLERANCE and shift @ outward > 0.0:
            point[w], normal[w] = on_skin, outward
            covariance[w] += (SKIN_DEVIATION**2 - variance) * np.outer(shift, shift)
    return replace(place, point=point, normal=normal, covariance=covariance)
