"""Points on the arm's surface, uniform by area, for methods that sample the skin."""

from typing import NamedTuple

import numpy as np

from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.robots.surface.union import distances

_SHELL = 0.002
"""Points up to this far outside [m] are moved onto the surface: a thin shell has as much volume as area."""


class Table(NamedTuple):
    """Points on the surface, sorted by link, in the frames of the links."""

    point: np.ndarray
    """Shape (M, 3) [m]."""
    normal: np.ndarray
    """Outward unit normals, shape (M, 3)."""
    link: np.ndarray
    """Index of the link, ascending, shape (M,), int64."""
    area: np.ndarray
    """Area of each link's surface [m^2], shape (links,)."""


def scattered(surfaces: Surfaces, density: float, seed: int = 0) -> Table:
    """Random points, uniform by area, on the unions of primitives of all links.

    Args:
        surfaces: Packed primitives.
        density: Points per area [1/m^2].
        seed: Random seed.
    """
    rng = np.random.default_rng(seed)
    parts = []
    for link in range(len(surfaces.start) - 1):
        points, normals, area = _link(surfaces, link, density, rng)
        parts.append((points, normals, np.full(len(points), link), area))
    points, normals, links, areas = zip(*parts, strict=True)
    return Table(np.concatenate(points), np.concatenate(normals), np.concatenate(links), np.array(areas))


def spread(surfaces: Surfaces, spacing: float, seed: int = 0) -> Table:
    """Points about `spacing` [m] apart: in each cell of a grid, the random point nearest to its centre."""
    dense = scattered(surfaces, 8.0 / spacing**2, seed)
    cell = np.floor(dense.point / spacing).astype(np.int64)
    off = np.linalg.norm(dense.point - (cell + 0.5) * spacing, axis=1)
    order = np.argsort(off, kind="stable")
    keys = np.column_stack((dense.link, cell))[order]
    first = np.unique(keys, axis=0, return_index=True)[1]
    chosen = np.sort(order[first])
    return Table(dense.point[chosen], dense.normal[chosen], dense.link[chosen], dense.area)


def _link(
    surfaces: Surfaces, link: int, density: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, float]:
    own = slice(surfaces.start[link], surfaces.start[link + 1])
    reach = surfaces.radius[own, None] + _SHELL
    if len(reach) == 0:
        return np.zeros((0, 3)), np.zeros((0, 3)), 0.0
    low, high = (surfaces.origin[own] - reach).min(axis=0), (surfaces.origin[own] + reach).max(axis=0)
    box = float(np.prod(high - low))
    tries = int(np.ceil(density / _SHELL * box))
    found = [_shell(surfaces, link, low, high, count, rng) for count in _batches(tries)]
    points, normals = (np.concatenate(part) for part in zip(*found, strict=True))
    return points, normals, len(points) / tries * box / _SHELL


def _batches(count: int) -> list[int]:
    whole, rest = divmod(count, 1_000_000)
    return [1_000_000] * whole + ([rest] if rest else [])


def _shell(
    surfaces: Surfaces, link: int, low: np.ndarray, high: np.ndarray, count: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    points = rng.uniform(low, high, size=(count, 3))
    distance, _, normal = distances(surfaces, points, link)
    near = (distance > 0.0) & (distance < _SHELL)
    return points[near] - distance[near, None] * normal[near], normal[near]
