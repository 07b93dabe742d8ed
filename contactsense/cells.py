"""Scratch of the search over all places."""

from typing import NamedTuple

import numpy as np


class Cells(NamedTuple):
    """What the search over S places keeps."""

    score: np.ndarray
    """Log evidence of each cell, shape (S,)."""
    point: np.ndarray
    """Most probable place in each cell, link frame, shape (S, 3) [m]."""
    force: np.ndarray
    """Most probable force there, link frame, shape (S, 3) [N]."""
    variance: np.ndarray
    """Variance of the place within the cell, mean over both tangents, shape (S,) [m^2]."""
    wrench: np.ndarray
    """Fused wrench in a link's frame, shape (6,) [N, Nm]."""
    information: np.ndarray
    """Its information matrix, shape (6, 6)."""
    rest: np.ndarray
    """Log evidence on each link that no explanation stands for, shape (links,)."""


def empty_cells(places: int, links: int) -> Cells:
    """Arrays for that many places."""
    return Cells(
        score=np.zeros(places),
        point=np.zeros((places, 3)),
        force=np.zeros((places, 3)),
        variance=np.zeros(places),
        wrench=np.zeros(6),
        information=np.zeros((6, 6)),
        rest=np.zeros(links),
    )
