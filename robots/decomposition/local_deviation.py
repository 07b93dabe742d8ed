"""How far the skin of a link is from its primitives, place by place.

At edges, ribs, recesses and fillets it is several millimetres, and the normals differ by tens of degrees; on
plain faces it is a tenth of a millimetre. So the primitives' surface is divided into cells, and each cell has
the root mean square of its samples.
"""

import numpy as np
from scipy.cluster.vq import kmeans2

from contactsense.robots.decomposition.least_squares_fit import Bodies
from contactsense.robots.decomposition.outer_skin import Skin
from contactsense.robots.decomposition.surface_error import packed
from contactsense.robots.robot import LocalDeviation
from contactsense.robots.surface.union import distances

CELL = 0.04
"""Edge of a cell [m]. Cells of half the edge explain the distances of a UR10e hardly better."""
LEAST = 5e-5
"""Smallest standard deviation of the distance [m]: rounding of the primitives' dimensions, facets."""
LARGEST_TILT = 0.6
"""Larger angles between normals count as this one [rad]: two walls of a thin rib are not one surface."""
PRIOR_SAMPLES = 3.0
"""A cell's mean squares are those of its samples and of this many with the mean square of its primitive."""


def local_deviation(bodies: Bodies, skin: Skin, seed: int = 0) -> tuple[LocalDeviation, ...]:
    """Standard deviations of distance and normal in each cell of the primitives of one link.

    Args:
        bodies: Primitives of the link.
        skin: Its skin; samples count by the fraction of poses in which they can be touched.
        seed: Of the division into cells.
    """
    exposed = skin.exposure > 0.0
    points = skin.points[exposed]
    offset, primitive, normal = distances(packed(bodies), points)
    squared_offset = np.maximum(offset**2, LEAST**2)
    angle = np.arccos(np.clip(np.einsum("ij,ij->i", normal, skin.normals[exposed]), -1.0, 1.0))
    squared_tilt = 0.5 * np.minimum(angle, LARGEST_TILT) ** 2
    points, weight = points - offset[:, None] * normal, skin.exposure[exposed]
    cells: list[LocalDeviation] = []
    for number in range(len(bodies.kind)):
        mine = primitive == number
        if not mine.any():
            continue
        count = max(round(skin.area * mine.sum() / len(skin.points) / CELL**2), 1)
        center, cell = kmeans2(points[mine], count, minit="++", rng=np.random.default_rng(seed))
        offsets, tilts = (
            _deviations(values[mine], weight[mine], cell, count) for values in (squared_offset, squared_tilt)
        )
        for place, h, d in zip(center, offsets, tilts, strict=True):
            x, y, z = (float(value) for value in place)
            cells.append(LocalDeviation(number, (x, y, z), float(h), float(d)))
    return tuple(cells)


def _deviations(squares: np.ndarray, weight: np.ndarray, cell: np.ndarray, count: int) -> np.ndarray:
    """Weighted root mean squares of the samples in each of `count` cells."""
    mean = np.average(squares, weights=weight)
    total = np.bincount(cell, weight, minlength=count) + PRIOR_SAMPLES
    sums = np.bincount(cell, weight * squares, minlength=count) + PRIOR_SAMPLES * mean
    return np.asarray(np.sqrt(sums / total))


def lines(cells: tuple[LocalDeviation, ...]) -> list[str]:
    """Cells as lines of a surface file, see `contactsense.robots.yaml_schema.LinkSurface`."""
    return [
        f"{cell.primitive} {' '.join(f'{1e3 * value:.0f}' for value in cell.point)} "
        f"{1e3 * cell.offset:.2f} {np.degrees(cell.tilt):.0f}"
        for cell in cells
    ]
