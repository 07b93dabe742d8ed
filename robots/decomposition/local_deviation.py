"""How far the skin of a link is from its primitives, place by place.

At edges, ribs, recesses and fillets it is several millimetres, and the normals differ by tens of degrees; on
plain faces it is a tenth of a millimetre. So the primitives' surface is divided into cells, and each cell has
the root mean square of its samples. A coarse primitive passes centimetres below a whole housing or above a
whole waist: there each cell also has the motion of the primitive's surface to the mean of its samples.
"""

from typing import NamedTuple

import numpy as np
from scipy.cluster.vq import kmeans2
from scipy.spatial.distance import cdist

from contactsense.robots.decomposition.least_squares_fit import Bodies
from contactsense.robots.decomposition.outer_skin import Skin
from contactsense.robots.decomposition.surface_error import packed
from contactsense.robots.robot import LocalDeviation
from contactsense.robots.rotations import rotation_from_vector
from contactsense.robots.surface.union import distances

CELL = 0.04
"""Edge of a cell [m]. Cells of half the edge explain the distances of a UR10e hardly better."""
MOVED_CELL = 0.028
"""Edge of a cell in which the surface is moved [m]: the skin is followed closer, and each cell still has
dozens of samples. On a UR3e of own truth it places contacts by a third closer than `CELL` does."""
CELL_SAMPLES = 16
"""Cells are larger where they would have fewer samples, as on a fence of some square metres."""
LEAST = 5e-5
"""Smallest standard deviation of the distance [m]: rounding of the primitives' dimensions, facets."""
LARGEST_TILT = 0.6
"""Larger angles between normals count as this one [rad]: two walls of a thin rib are not one surface."""
PRIOR_SAMPLES = 3.0
"""A cell's mean squares are those of its samples and of this many with the mean square of its primitive."""

_NO_SIDE = 1e-9
"""The normals of a cell with as much of one face of a thin plate as of the other have no mean."""


class _Samples(NamedTuple):
    """N samples of the skin whose nearest point on the primitives is on one of them."""

    foot: np.ndarray
    """That point, shape (N, 3) [m]."""
    offset: np.ndarray
    """Signed distance from it, positive where the skin is above the primitive, shape (N,) [m]."""
    normal: np.ndarray
    """The primitive's outward unit normal there, shape (N, 3)."""
    skin_normal: np.ndarray
    """The skin's, shape (N, 3)."""
    weight: np.ndarray
    """Fraction of poses in which the sample can be touched, shape (N,)."""

    def part(self, rows: np.ndarray) -> "_Samples":
        """Some of the samples."""
        return _Samples(*(values[rows] for values in self))


class _Motion(NamedTuple):
    """How the surface of a primitive is moved to the mean of the skin in one cell, and what remains."""

    shift: np.ndarray
    """Shape (3,) [m]."""
    turn: np.ndarray
    """Rotation vector, shape (3,) [rad]."""
    offset: np.ndarray
    """Distances of the samples from the moved surface, shape (N,) [m]."""
    normal: np.ndarray
    """Its normals, shape (N, 3)."""


def local_deviation(
    bodies: Bodies, skin: Skin, seed: int = 0, moved: bool = False
) -> tuple[LocalDeviation, ...]:
    """Standard deviations of distance and normal in each cell of the primitives of one link.

    Args:
        bodies: Primitives of the link.
        skin: Its skin; samples count by the fraction of poses in which they can be touched.
        seed: Of the division into cells.
        moved: Whether the primitive's surface is moved to the skin's mean in each cell, which is worth it
            where it is off by more than it is rough: on coarse primitives.
    """
    exposed = skin.exposure > 0.0
    points = skin.points[exposed]
    offset, primitive, normal = distances(packed(bodies), points)
    samples = _Samples(
        points - offset[:, None] * normal, offset, normal, skin.normals[exposed], skin.exposure[exposed]
    )
    edge = MOVED_CELL if moved else CELL
    cells: list[LocalDeviation] = []
    for number in range(len(bodies.kind)):
        mine = samples.part(primitive == number)
        if not len(mine.offset):
            continue
        count = round(skin.area * len(mine.offset) / len(skin.points) / edge**2)
        count = max(min(count, len(mine.offset) // CELL_SAMPLES), 1)
        seeds = _seeds(mine.foot, count, np.random.default_rng(seed))
        center, cell = kmeans2(mine.foot, seeds, minit="matrix")
        squared_offset, squared_tilt = np.empty(len(cell)), np.empty(len(cell))
        motions = []
        for i in range(count):
            here = mine.part(cell == i)
            motion = _to_the_mean(here, center[i]) if moved else _unmoved(here)
            squared_offset[cell == i] = np.maximum(motion.offset**2, LEAST**2)
            cosine = np.einsum("ij,ij->i", motion.normal, here.skin_normal)
            squared_tilt[cell == i] = (
                0.5 * np.minimum(np.arccos(np.clip(cosine, -1.0, 1.0)), LARGEST_TILT) ** 2
            )
            motions.append(motion)
        offsets, tilts = (
            _deviations(values, mine.weight, cell, count) for values in (squared_offset, squared_tilt)
        )
        for place, h, d, motion in zip(center, offsets, tilts, motions, strict=True):
            cells.append(
                LocalDeviation(
                    number, _vector(place), float(h), float(d), _vector(motion.shift), _vector(motion.turn)
                )
            )
    return tuple(cells)


def _seeds(points: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """First centres of `count` cells by k-means++, shape (count, 3) [m]: those that `kmeans2` draws, which
    measures the distances from all former centres for each further one and takes hours for a fence."""
    chosen = np.empty((count, 3))
    chosen[0] = points[rng.integers(len(points))]
    nearest = np.full(len(points), np.inf)
    for i in range(1, count):
        nearest = np.minimum(nearest, cdist(chosen[i - 1 : i], points, "sqeuclidean")[0])
        share = np.cumsum(nearest / nearest.sum())
        chosen[i] = points[min(int(np.searchsorted(share, rng.uniform())), len(points) - 1)]
    return chosen


def _unmoved(samples: _Samples) -> _Motion:
    return _Motion(np.zeros(3), np.zeros(3), samples.offset, samples.normal)


def _to_the_mean(samples: _Samples, center: np.ndarray) -> _Motion:
    """Motion of the primitive's surface to the plane of least squares through the distances of one cell's
    samples.

    As for the deviations, `PRIOR_SAMPLES` more samples count: without distance, as far from the centre as
    those of a square cell are.
    """
    total = float(samples.weight.sum())
    up = samples.weight @ samples.normal
    length = float(np.linalg.norm(up))
    if length <= _NO_SIDE * total:
        return _unmoved(samples)
    up /= length
    across = samples.foot - center
    across -= np.outer(across @ up, up)
    mean = float(samples.weight @ samples.offset) / (total + PRIOR_SAMPLES)
    weighted = across.T * samples.weight
    slope = np.linalg.solve(
        weighted @ across + PRIOR_SAMPLES * MOVED_CELL**2 / 12.0 * np.eye(3),
        weighted @ (samples.offset - mean),
    )
    steepness = float(np.linalg.norm(slope))
    if steepness > np.tan(LARGEST_TILT):
        slope *= np.tan(LARGEST_TILT) / steepness
        steepness = np.tan(LARGEST_TILT)
    # The surface rises along the slope, so that its normal leans against it.
    turn = np.cross(slope, up)
    if steepness > 0.0:
        turn *= np.arctan(steepness) / steepness
    return _Motion(
        mean * up, turn, samples.offset - mean - across @ slope, samples.normal @ rotation_from_vector(turn).T
    )


def _vector(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _deviations(squares: np.ndarray, weight: np.ndarray, cell: np.ndarray, count: int) -> np.ndarray:
    """Weighted root mean squares of the samples in each of `count` cells."""
    mean = np.average(squares, weights=weight)
    total = np.bincount(cell, weight, minlength=count) + PRIOR_SAMPLES
    sums = np.bincount(cell, weight * squares, minlength=count) + PRIOR_SAMPLES * mean
    return np.asarray(np.sqrt(sums / total))
