"""Which of the arm's places the search for several contacts starts from."""

from typing import NamedTuple

import numpy as np

from contactsense.arm import Arm

FEW = 160
"""Places among which pairs are sought; one further contact is sought among all."""
TURN = 0.03
"""Distance that a turn of the normal by one radian counts as when they are chosen [m]."""


class Choice(NamedTuple):
    """A few of the places of `contactsense.places` that still cover the arm."""

    primitive: np.ndarray
    """Primitive of every place, shape (S,), int64."""
    link: np.ndarray
    """Its link, shape (S,), int64."""
    spread: np.ndarray
    """Standard deviation of its cell along each tangent, shape (S,) [m]."""
    few: np.ndarray
    """Numbers of the chosen places, shape (at most FEW,), int64."""
    coarser: float
    """How much wider a chosen place's cell is than that of a place."""


def choose_places(arm: Arm) -> Choice:
    """Choose each place as far as possible from those before it."""
    places = arm.places
    link = arm.surfaces.link[places.primitive]
    feature = np.column_stack((places.point, TURN * places.normal, 10.0 * link))
    nearest = np.full(len(feature), np.inf)
    few: list[int] = []
    for _ in range(min(FEW, len(feature))):
        few.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, np.linalg.norm(feature - feature[few[-1]], axis=1))
    coarser = float(np.sqrt(len(feature) / len(few))) if few else 1.0
    return Choice(
        places.primitive.copy(), link.copy(), places.spread.copy(), np.array(few, dtype=np.int64), coarser
    )
