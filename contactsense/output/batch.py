"""Best candidates of many measurements of an arm at rest, as arrays."""

from typing import NamedTuple

import numpy as np

from contactsense.robots.attribute_docs import with_attributes
from contactsense.runtime.result_rows import (
    COVARIANCE,
    FORCE,
    LINK,
    NORMAL,
    POINT_BASE,
    PRIMITIVE,
    PROBABILITY,
    TORSION,
)


@with_attributes
class Batch(NamedTuple):
    """Best candidate of each of N samples, as arrays; base axes unless stated otherwise."""

    link: np.ndarray
    """Index of the touched link, -1 if no push on any link explains the sample, shape (N,), int64."""
    primitive: np.ndarray
    """Index of the touched primitive among all of the arm, shape (N,), int64."""
    probability: np.ndarray
    """Probability of this candidate, shape (N,)."""
    link_probability: np.ndarray
    """Probability of each link, shape (N, links)."""
    point_base: np.ndarray
    """Contact centroid, base frame, shape (N, 3) [m]."""
    normal_base: np.ndarray
    """Outward unit normal, shape (N, 3)."""
    force_base: np.ndarray
    """Force on the robot, shape (N, 3) [N]."""
    torsion: np.ndarray
    """Moment on the robot about the outward normal, shape (N,) [Nm]."""
    covariance: np.ndarray
    """Covariance of `point_base`, shape (N, 3, 3) [m^2]."""
    detected: np.ndarray
    """Whether a contact is detected: noise alone is too improbable an explanation, shape (N,), bool."""


def batch_of(rows: np.ndarray, link_probability: np.ndarray, detected: np.ndarray) -> Batch:
    """The batch of N samples from the best row of each.

    Args:
        rows: See `contactsense.runtime.result_rows`, shape (N, WIDTH).
        link_probability, detected: See `Batch`.
    """
    return Batch(
        link=rows[:, LINK].astype(np.int64),
        primitive=rows[:, PRIMITIVE].astype(np.int64),
        probability=rows[:, PROBABILITY],
        link_probability=link_probability,
        point_base=rows[:, POINT_BASE],
        normal_base=rows[:, NORMAL],
        force_base=rows[:, FORCE],
        torsion=rows[:, TORSION],
        covariance=rows[:, COVARIANCE].reshape(len(rows), 3, 3),
        detected=detected,
    )
