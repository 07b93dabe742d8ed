"""What a search for one contact is given."""

from typing import NamedTuple

import numpy as np

from contactsense.isolation.link_hypotheses import Hypotheses
from contactsense.kinematics.model import Motion
from contactsense.localization.problem.searched_surface import SearchedSurface
from contactsense.solvers.posterior.contact_prior import Prior


class SingleContactProblem(NamedTuple):
    """A measurement that one contact is to explain, and what is known of that contact before."""

    scene: SearchedSurface
    """The scene's surface."""
    searched: np.ndarray
    """1 for links that are searched, else 0, shape (links,), int64."""
    motion: Motion
    """Poses, see `contactsense.kinematics.forward_kinematics.forward_kinematics`."""
    hypotheses: Hypotheses
    """One fused wrench per link, see `contactsense.isolation.link_hypotheses.isolate`."""
    wrench_measured: bool
    """Whether all six components of the wrench were measured."""
    prior: Prior
    """Prior of contacts."""
