"""Selects the surface samples at which the search for several contacts starts."""

from typing import Annotated, NamedTuple

import numpy as np

from contactsense.robots.jit.declaration import Floats, Integers
from contactsense.runtime.constants import Constants

MAX_SEED_SAMPLES = 160
"""Number of samples of which pairs are formed; a single further contact is searched among all."""
NORMAL_WEIGHT = 0.03
"""Distance that corresponds to a turn of the normal by one radian in the selection [m]."""


class SeedSamples(NamedTuple):
    """The samples of `contactsense.localization.surface_samples`, and a coarse subset that covers the
    arm."""

    primitive: Annotated[Integers, "samples"]
    """Primitive of every sample."""
    link: Annotated[Integers, "samples"]
    """Its link."""
    spread: Annotated[Floats, "samples"]
    """Standard deviation of its cell along each tangent [m]."""
    coarse: Annotated[Integers, "coarse"]
    """Indices of the coarse subset, at most MAX_SEED_SAMPLES."""
    coarse_factor: float
    """Ratio of the cell size of the subset to that of all samples."""


def choose_seed_samples(constants: Constants) -> SeedSamples:
    """Select the subset by farthest-point sampling."""
    samples = constants.samples
    link = constants.surfaces.link[samples.primitive]
    features = np.column_stack((samples.point, NORMAL_WEIGHT * samples.normal, 10.0 * link))
    nearest = np.full(len(features), np.inf)
    coarse: list[int] = []
    for _ in range(min(MAX_SEED_SAMPLES, len(features))):
        coarse.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, np.linalg.norm(features - features[coarse[-1]], axis=1))
    coarse_factor = float(np.sqrt(len(features) / len(coarse))) if coarse else 1.0
    return SeedSamples(
        samples.primitive.copy(),
        link.copy(),
        samples.spread.copy(),
        np.array(coarse, dtype=np.int64),
        coarse_factor,
    )
