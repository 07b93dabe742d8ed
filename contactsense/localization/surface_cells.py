"""Result and scratch arrays of the search over the surface."""

from typing import NamedTuple

import numpy as np

from contactsense.localization.simd_layout import LANES, LENGTH


class SurfaceCells(NamedTuple):
    """Cells that the search over the surface evaluates, one per row: samples and subsamples."""

    score: np.ndarray
    """Log evidence, shape (R,); -infinity if the cell is rejected or already merged."""
    point: np.ndarray
    """Most probable contact point in the cell, link frame, shape (R, 3) [m]."""
    normal: np.ndarray
    """Outward unit normal, link frame, shape (R, 3)."""
    force: np.ndarray
    """Most probable force there, link frame, shape (R, 3) [N]."""
    variance: np.ndarray
    """Variance of the point within the cell, mean over both tangents, shape (R,) [m^2]."""
    spread: np.ndarray
    """Standard deviation of the cell along each tangent, shape (R,) [m]."""
    wrench: np.ndarray
    """Fused wrench in the frame of one link, shape (6,) [N, Nm]."""
    information: np.ndarray
    """Its information matrix, shape (6, 6)."""
    unassigned_evidence: np.ndarray
    """Log evidence on each link that is not part of any candidate, shape (links,)."""
    link_energy: np.ndarray
    """Energy of each link's hypothesis less the log density of places on it, shape (links,)."""
    bound_block: np.ndarray
    """Block of cells for `contactsense.localization.energy_bound`, shape (LENGTH,)."""
    mode_block: np.ndarray
    """Block of cells for `contactsense.localization.laplace_evidence`, shape (LENGTH,)."""
    bound_sample: np.ndarray
    """Sample of each cell in `bound_block`, shape (LANES,), int64."""
    mode_sample: np.ndarray
    """Sample or subsample of each cell in `mode_block`, shape (LANES,), int64."""
    primitive: np.ndarray
    """Primitive of each row, shape (R,), int64."""
    sample: np.ndarray
    """Sample of each row; undefined for subsamples, shape (R,), int64."""


def empty_surface_cells(samples: int, subsamples: int, links: int) -> SurfaceCells:
    """Zero-filled arrays for that many samples, subsamples and links."""
    rows = samples + subsamples
    return SurfaceCells(
        score=np.zeros(rows),
        point=np.zeros((rows, 3)),
        normal=np.zeros((rows, 3)),
        force=np.zeros((rows, 3)),
        variance=np.zeros(rows),
        spread=np.zeros(rows),
        wrench=np.zeros(6),
        information=np.zeros((6, 6)),
        unassigned_evidence=np.zeros(links),
        link_energy=np.zeros(links),
        bound_block=np.zeros(LENGTH),
        mode_block=np.zeros(LENGTH),
        bound_sample=np.zeros(LANES, dtype=np.int64),
        mode_sample=np.zeros(LANES, dtype=np.int64),
        primitive=np.zeros(rows, dtype=np.int64),
        sample=np.zeros(rows, dtype=np.int64),
    )
