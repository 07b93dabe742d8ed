"""Places on the touchable surface: a few hundred that stand for all of it where a measurement says little.

Each stands for a cell of the surface, so that a sum over places is an integral over the surface. The surface
is that of the union of a link's primitives: what lies inside another primitive is no place. Every cell is
made up of a few parts, to be looked at where the answer lies in few cells.
"""

import math
from typing import NamedTuple

import numpy as np

from robots.surface import Surfaces
from robots.union import distances

COUNT = 480
"""Places on an arm, about: cells of some 35 mm on a UR5e."""
PARTS = 4
"""Most parts of a cell: some 17 mm on a UR5e."""
GRID = 0.006
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
    primitive: np.ndarray
    """Primitive on which it lies, shape (S,), int64."""
    start: np.ndarray
    """First place of each primitive, and their number at the end, shape (P + 1,), int64."""


class Parts(NamedTuple):
    """T parts of the cells of S places, sorted by cell; link frames."""

    point: np.ndarray
    """On the surface, shape (T, 3) [m]."""
    normal: np.ndarray
    """Outward unit normal, shape (T, 3)."""
    spread: np.ndarray
    """Standard deviation of the part along each tangent, shape (T,) [m]."""
    log_share: np.ndarray
    """Logarithm of the part's share of the touchable area, shape (T,)."""
    primitive: np.ndarray
    """Primitive on which it lies, which need not be that of the cell's place, shape (T,), int64."""
    start: np.ndarray
    """First part of each cell, and their number at the end, shape (S + 1,), int64."""


class Patches(NamedTuple):
    """N pieces of one link's surface and what stands for them; link frame."""

    point: np.ndarray
    """On the surface, shape (N, 3) [m]."""
    normal: np.ndarray
    """Outward unit normal, shape (N, 3)."""
    primitive: np.ndarray
    """Primitive on which each lies, shape (N,), int64."""
    spread: np.ndarray
    """Standard deviation along each tangent, shape (N,) [m]."""
    area: np.ndarray
    """Shape (N,) [m^2]."""


def find_places(surfaces: Surfaces) -> tuple[Places, Parts, float]:
    """Places on all primitives, the parts of their cells, and the area of the touchable surface [m^2].

    The area is the volume of a shell about the surface over its thickness, each point of a grid in it being
    weighed by a smooth window, so that curvature cancels; a grid point stands for the surface point nearest
    to it.
    """
    links = len(surfaces.start) - 1
    shells = [_shell(surfaces, link) for link in range(links)]
    area = sum(float(shell.area.sum()) for shell in shells)
    edge = math.sqrt(area / COUNT)
    cells: list[Patches] = []
    parts: list[Patches] = []
    for shell in shells:
        if not len(shell.area):
            continue
        count = max(round(float(shell.area.sum()) / edge**2), 1)
        owner = _split(shell, edge, count)
        cells.append(_stand_in(shell, owner))
        for i in range(len(cells[-1].area)):
            member = Patches(*(values[owner == i] for values in shell))
            parts.append(_stand_in(member, _split(member, edge / math.sqrt(PARTS), PARTS)))
    if not cells:
        return *_none(len(surfaces.kind)), 1.0
    cell = Patches(*(np.concatenate(values) for values in zip(*cells, strict=True)))
    order = np.argsort(cell.primitive, kind="stable")
    start = np.searchsorted(cell.primitive[order], np.arange(len(surfaces.kind) + 1)).astype(np.int64)
    point, normal, primitive, spread, weight = (values[order] for values in cell)
    places = Places(point, normal, spread, np.log(weight / area), primitive, start)
    parts = [parts[i] for i in order]
    first = np.cumsum([0] + [len(part.area) for part in parts]).astype(np.int64)
    point, normal, primitive, spread, weight = (np.concatenate(values) for values in zip(*parts, strict=True))
    return places, Parts(point, normal, spread, np.log(weight / area), primitive, first), area


def _none(primitives: int) -> tuple[Places, Parts]:
    blank, line = np.zeros((0, 3)), np.zeros(0)
    on, start = np.zeros(0, dtype=np.int64), np.zeros(primitives + 1, dtype=np.int64)
    return Places(blank, blank, line, line, on, start), Parts(blank, blank, line, line, on, start[:1])


def _shell(surfaces: Surfaces, link: int) -> Patches:
    """Surface points of a link, with their areas; their spread is not known."""
    first, last = surfaces.start[link], surfaces.start[link + 1]
    if first == last:
        return Patches(
            np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0)
        )
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
    kept = Patches(point, normal, which.astype(np.int64), np.zeros(len(point)), weight)
    return Patches(*(values[outside] for values in kept))


def _split(patches: Patches, edge: float, count: int) -> np.ndarray:
    """For each patch the number of the one that it is nearest to, of `count` that are far from each other in
    place and normal: a quarter turn of the normal counts as far as `edge` [m], one cell's."""
    feature = _feature(patches, edge)
    nearest = np.full(len(feature), np.inf)
    owner = np.zeros(len(feature), dtype=np.int64)
    chosen = int(np.argmax(np.linalg.norm(patches.point - patches.point.mean(axis=0), axis=1)))
    for i in range(count):
        distance = ((feature - feature[chosen]) ** 2).sum(axis=1)
        closer = distance < nearest
        nearest[closer], owner[closer] = distance[closer], i
        chosen = int(np.argmax(nearest))
        if nearest[chosen] == 0.0:
            # Fewer different points than cells.
            break
    return owner


def _feature(patches: Patches, edge: float) -> np.ndarray:
    return np.hstack((patches.point, patches.normal * (edge / math.sqrt(2.0))))


def _stand_in(patches: Patches, owner: np.ndarray) -> Patches:
    """Each cell as one patch: the member that is nearest to its centre, and how far the others are spread."""
    area = np.bincount(owner, patches.area)
    edge = math.sqrt(float(area.mean()))
    feature = _feature(patches, edge)
    centre = np.stack([np.bincount(owner, patches.area * column) / area for column in feature.T], axis=1)
    off = ((feature - centre[owner]) ** 2).sum(axis=1)
    best = np.lexsort((off, owner))
    best = best[np.searchsorted(owner[best], np.arange(len(area)))]
    away = patches.point - patches.point[best][owner]
    flat = (away**2).sum(axis=1) - (away * patches.normal[best][owner]).sum(axis=1) ** 2
    spread = np.sqrt(np.bincount(owner, patches.area * flat) / area / 2.0)
    spread = np.maximum(spread, np.sqrt(area / 12.0) / 2.0)
    return Patches(patches.point[best], patches.normal[best], patches.primitive[best], spread, area)
