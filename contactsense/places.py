"""Places on the touchable surface: a few hundred that stand for all of it where a measurement says little.

Each stands for a cell of the surface, so that a sum over places is an integral over the surface. The surface
is that of the union of a link's primitives: what lies inside another primitive is no place.
"""

from typing import NamedTuple

import numpy as np

from robots.surface import Surfaces
from robots.union import distances

COUNT = 480
"""Places on an arm, about: cells of some 35 mm on a UR5e. Twice as many would make the answers a little
better where the noise is large, and take half as long again there."""
GRID = 0.01
"""Widest spacing of the grid on which the surface's area is measured [m]."""
FINEST = 0.05
"""Spacing of the grid on a small link, as a part of its radius."""
MOUNTED = 0.002
"""Places of the base link lower than this and facing down are on the mounting plane [m]."""


class Places(NamedTuple):
    """S places, sorted by primitive; link frames."""

    point: np.ndarray
    """On the surface, shape (S, 3) [m]."""
    normal: np.ndarray
    """Outward unit normal, shape (S, 3)."""
    spread: np.ndarray
    """Standard deviation of the cell along each tangent, shape (S,) [m]."""
    log_share: np.ndarray
    """Logarithm of the cell's share of the touchable area, shape (S,)."""
    start: np.ndarray
    """First place of each primitive, and their number at the end, shape (P + 1,), int64."""


def find_places(surfaces: Surfaces) -> tuple[Places, float]:
    """Places on all primitives, and the area of the touchable surface [m^2].

    The area is the volume of a shell about the surface over its thickness, each point of a grid in it being
    weighed by a smooth window, so that curvature cancels; a grid point stands for the surface point nearest
    to it.
    """
    links = len(surfaces.start) - 1
    found = [_shell(surfaces, link) for link in range(links)]
    area = sum(float(weight.sum()) for _, _, _, weight in found)
    cells = [_gather(*shell, area / COUNT) for shell in found if len(shell[0])]
    if not cells:
        return _none(len(surfaces.kind)), 1.0
    point, normal, primitive, spread, weight = (np.concatenate(parts) for parts in zip(*cells, strict=True))
    order = np.argsort(primitive, kind="stable")
    start = np.searchsorted(primitive[order], np.arange(len(surfaces.kind) + 1)).astype(np.int64)
    share = np.log(weight[order] / area)
    return Places(point[order], normal[order], spread[order], share, start), area


def _none(primitives: int) -> Places:
    start = np.zeros(primitives + 1, dtype=np.int64)
    return Places(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0), start)


def _shell(surfaces: Surfaces, link: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Surface points of a link, their normals, primitives and areas."""
    first, last = surfaces.start[link], surfaces.start[link + 1]
    if first == last:
        return np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=np.int64), np.zeros(0)
    spacing = min(GRID, FINEST * float(surfaces.radius[first:last].max()))
    # Half thickness of the shell.
    shell = 1.5 * spacing
    reach = surfaces.radius[first:last, None] + shell
    low = (surfaces.origin[first:last] - reach).min(axis=0)
    high = (surfaces.origin[first:last] + reach).max(axis=0)
    axes = [np.arange(low[i], high[i] + spacing, spacing) for i in range(3)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    distance, which, normal = distances(surfaces, grid, link)
    near = np.abs(distance) < shell
    grid, distance, which, normal = grid[near], distance[near], which[near], normal[near]
    weight = spacing**3 * (1.0 + np.cos(np.pi * distance / shell)) / (2.0 * shell)
    point = grid - distance[:, None] * normal
    outside = distances(surfaces, point, link)[0] > -spacing / 4
    if link == 0:
        outside &= (point[:, 2] > MOUNTED) | (normal[:, 2] > -0.5)
    return point[outside], normal[outside], which[outside], weight[outside]


def _gather(
    point: np.ndarray, normal: np.ndarray, primitive: np.ndarray, weight: np.ndarray, cell: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Cells of about the area `cell`: points far from each other in place and normal, each with its
    neighbours."""
    count = min(max(round(float(weight.sum()) / cell), 1), len(point))
    # A quarter turn of the normal counts as far as one cell's edge.
    feature = np.hstack((point, normal * np.sqrt(cell / 2.0)))
    chosen = np.zeros(count, dtype=np.int64)
    nearest = np.full(len(point), np.inf)
    owner = np.zeros(len(point), dtype=np.int64)
    chosen[0] = int(np.argmax(np.linalg.norm(point - point.mean(axis=0), axis=1)))
    for i in range(count):
        if i > 0:
            chosen[i] = int(np.argmax(nearest))
            if nearest[chosen[i]] == 0.0:
                # Fewer different points than cells.
                chosen = chosen[:i]
                break
        distance = ((feature - feature[chosen[i]]) ** 2).sum(axis=1)
        closer = distance < nearest
        nearest[closer], owner[closer] = distance[closer], i
    total = np.bincount(owner, weight)
    centre = np.stack([np.bincount(owner, weight * feature[:, i]) / total for i in range(6)], axis=1)
    # The member that is nearest to its cell's centre stands for the cell.
    off = ((feature - centre[owner]) ** 2).sum(axis=1)
    best = np.lexsort((off, owner))
    best = best[np.searchsorted(owner[best], np.arange(len(chosen)))]
    away = point - point[best][owner]
    flat = (away**2).sum(axis=1) - (away * normal[best][owner]).sum(axis=1) ** 2
    spread = np.sqrt(np.bincount(owner, weight * flat) / total / 2.0)
    return point[best], normal[best], primitive[best], np.maximum(spread, np.sqrt(total / 12.0) / 2.0), total
