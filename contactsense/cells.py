"""Scratch of the search over all places."""

from typing import NamedTuple

import numpy as np

from contactsense.lanes import LANES, LENGTH


class Cells(NamedTuple):
    """What the search over places and parts of their cells keeps, in as many rows as were not given up."""

    score: np.ndarray
    """Log evidence, shape (R,); -infinity: not to be looked at any more."""
    point: np.ndarray
    """Most probable place in the cell, link frame, shape (R, 3) [m]."""
    normal: np.ndarray
    """The cell's outward unit normal, link frame, shape (R, 3)."""
    force: np.ndarray
    """Most probable force there, link frame, shape (R, 3) [N]."""
    variance: np.ndarray
    """Variance of the place within the cell, mean over both tangents, shape (R,) [m^2]."""
    spread: np.ndarray
    """Standard deviation of the cell along each tangent, shape (R,) [m]."""
    wrench: np.ndarray
    """Fused wrench in a link's frame, shape (6,) [N, Nm]."""
    information: np.ndarray
    """Its information matrix, shape (6, 6)."""
    rest: np.ndarray
    """Log evidence on each link that no explanation stands for, shape (links,)."""
    looked: np.ndarray
    """The block of cells that is looked at, see `contactsense.lanes`, shape (LENGTH,)."""
    weighed: np.ndarray
    """The block of cells that is weighed, shape (LENGTH,)."""
    looked_number: np.ndarray
    """Numbers of the cells, or parts, in the first block, shape (LANES,), int64."""
    weighed_number: np.ndarray
    """Numbers of those in the second, shape (LANES,), int64."""
    primitive: np.ndarray
    """Primitive of each row, shape (R,), int64."""
    place: np.ndarray
    """Number of the place, of those rows that are no parts, shape (R,), int64."""


def empty_cells(places: int, parts: int, links: int) -> Cells:
    """Arrays for that many places and parts."""
    rows = places + parts
    return Cells(
        score=np.zeros(rows),
        point=np.zeros((rows, 3)),
        normal=np.zeros((rows, 3)),
        force=np.zeros((rows, 3)),
        variance=np.zeros(rows),
        spread=np.zeros(rows),
        wrench=np.zeros(6),
        information=np.zeros((6, 6)),
        rest=np.zeros(links),
        looked=np.zeros(LENGTH),
        weighed=np.zeros(LENGTH),
        looked_number=np.zeros(LANES, dtype=np.int64),
        weighed_number=np.zeros(LANES, dtype=np.int64),
        primitive=np.zeros(rows, dtype=np.int64),
        place=np.zeros(rows, dtype=np.int64),
    )
