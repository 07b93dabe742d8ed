"""How accurately the line of action of a measured wrench is known: that decides how contacts are searched."""

import numpy as np

from contactsense.isolation.link_hypotheses import Hypotheses
from contactsense.kinematics.model import Motion
from contactsense.localization.surface.line_distance import moment_variance
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.solvers.posterior.mode import ENERGY_CUTOFF

LINE_OF_ACTION_DEVIATION = 0.008
"""The line of action counts as known if its position has a smaller standard deviation than this near the link
that explains the measurement best [m]."""
ROUGH_LINE_DEVIATION = 0.025
"""It counts as roughly known if its position has a smaller standard deviation than this near all links that
explain the measurement [m]: if it enters few primitives, the search along it finds the same place as the one
over the surface, and is faster."""
UNKNOWN, ROUGHLY_KNOWN, KNOWN = range(3)


@fused_kernel
def line_accuracy(
    searched: np.ndarray, depth: np.ndarray, motion: Motion, hypotheses: Hypotheses, link: int
) -> int:
    """Whether the line of action is `KNOWN`, `ROUGHLY_KNOWN` or `UNKNOWN`.

    Args:
        searched, motion, hypotheses: As in
            `contactsense.localization.problem.single_contact_problem.SingleContactProblem`.
        depth: As in `contactsense.localization.problem.searched_surface.SearchedSurface`.
        link: The link that explains the measurement best.
    """
    if _is_within(LINE_OF_ACTION_DEVIATION, depth, motion, hypotheses, link):
        return KNOWN
    for other in range(depth.shape[0]):
        explains = (
            searched[other] != 0 and hypotheses.energy[other] <= hypotheses.energy[link] + ENERGY_CUTOFF
        )
        if explains and not _is_within(ROUGH_LINE_DEVIATION, depth, motion, hypotheses, other):
            return UNKNOWN
    return ROUGHLY_KNOWN


@fused_kernel
def _is_within(
    deviation: float, depth: np.ndarray, motion: Motion, hypotheses: Hypotheses, link: int
) -> bool:
    """Whether the position of the line of action for a link has a smaller standard deviation near the link's
    origin than `deviation` [m]. Other arguments as for `line_accuracy`."""
    w, o = hypotheses.wrench[link], motion.origin[depth[link]]
    squared_force = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    variance = moment_variance(hypotheses.covariance[link], o[0], o[1], o[2])
    return bool(variance < deviation * deviation * squared_force)
