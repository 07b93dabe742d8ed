"""Surface samples: a few hundred points, each with a cell of the touchable surface.

A sum over the samples is an integral over the surface. The surface is that of the union of a link's
primitives; points inside another primitive are excluded. Every cell is divided into a few subsamples, used
if the posterior is narrow.
"""

import functools
import math
from copy import deepcopy
from typing import Annotated, NamedTuple

import numpy as np

from contactsense.localization.surface.farthest_point_sampling import farthest_points_of_groups
from contactsense.robots.jit.declaration import Floats, Integers
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.robots.surface.union import distances

SAMPLES = 480
"""Approximate number of samples of a whole arm: cells of about 35 mm on a UR5e."""
SUBSAMPLES = 4
"""Maximum number of subsamples of a cell: about 17 mm on a UR5e."""
MAX_GRID_SPACING = 0.006
"""Maximum spacing of the grid that measures the surface area [m]."""
RELATIVE_GRID_SPACING = 0.05
"""Spacing of that grid on a small link, relative to its radius."""
BLOCK = 4
"""Points of that grid along each edge of a block; blocks that the surface cannot reach are left out."""
MOUNTING_HEIGHT = 0.002
"""Points of the base link below this height that face down are on the mounting face [m]."""


class SurfaceSamples(NamedTuple):
    """S samples, sorted by primitive; link frames."""

    point: Annotated[Floats, "samples, 3"]
    """Point of the surface [m]."""
    normal: Annotated[Floats, "samples, 3"]
    """Outward unit normal."""
    spread: Annotated[Floats, "samples"]
    """Standard deviation of the cell along each tangent [m]."""
    log_share: Annotated[Floats, "samples"]
    """Logarithm of the cell's share of the touchable area."""
    tilt: Annotated[Floats, "samples"]
    """Standard deviation of the angle between the real surface's normal and `normal`, along each tangent
    [rad]."""
    primitive: Annotated[Integers, "samples"]
    """Primitive on which it lies."""
    start: Annotated[Integers, "primitives + 1"]
    """First sample of each primitive, then the total number."""


class SurfaceSubsamples(NamedTuple):
    """T subsamples of the cells of S samples, sorted by cell; link frames."""

    point: Annotated[Floats, "subsamples, 3"]
    """Point of the surface [m]."""
    normal: Annotated[Floats, "subsamples, 3"]
    """Outward unit normal."""
    spread: Annotated[Floats, "subsamples"]
    """Standard deviation of the subcell along each tangent [m]."""
    log_share: Annotated[Floats, "subsamples"]
    """Logarithm of the subcell's share of the touchable area."""
    tilt: Annotated[Floats, "subsamples"]
    """Standard deviation of the angle between the real surface's normal and `normal`, along each tangent
    [rad]."""
    primitive: Annotated[Integers, "subsamples"]
    """Primitive on which it lies; may differ from that of the cell's sample."""
    start: Annotated[Integers, "samples + 1"]
    """First subsample of each cell, then the total number."""


class Patches(NamedTuple):
    """N patches of one link's surface, each with a representative point; link frame."""

    point: np.ndarray
    """Point of the surface, shape (N, 3) [m]."""
    normal: np.ndarray
    """Outward unit normal, shape (N, 3)."""
    primitive: np.ndarray
    """Primitive on which each lies, shape (N,), int64."""
    spread: np.ndarray
    """Standard deviation along each tangent, shape (N,) [m]."""
    area: np.ndarray
    """Shape (N,) [m^2]."""


def sample_surface(
    surfaces: Surfaces, unsearched_area: float = 0.0
) -> tuple[SurfaceSamples, SurfaceSubsamples, float]:
    """Samples of all primitives, their subsamples, and the area of the touchable surface [m^2]. No
    sample has a `tilt`: `contactsense.localization.surface.mean_surface.with_deviations`.

    `unsearched_area` is that of the arm's other links [m^2]: cells are no smaller where links are left out.

    Primitives beyond the last link's, which are of bodies that cover the arm, have no samples. The area is
    the volume of a shell around the surface divided by its thickness. Grid points in the shell are weighted
    by a smooth window, so that the effect of curvature cancels. Each grid point represents the nearest point
    of the surface.
    """
    arrays = tuple((array.tobytes(), array.dtype.str, array.shape) for array in surfaces)
    # What is kept must not change with what the caller does with it.
    return deepcopy(_sampled(arrays, unsearched_area))


@functools.lru_cache(maxsize=32)
def _sampled(
    arrays: tuple[tuple[bytes, str, tuple[int, ...]], ...], unsearched_area: float
) -> tuple[SurfaceSamples, SurfaceSubsamples, float]:
    """The samples of surfaces whose arrays have these contents: scenes of one cell share them."""
    surfaces = Surfaces(
        *(np.frombuffer(content, dtype).reshape(shape).copy() for content, dtype, shape in arrays)
    )
    links = len(surfaces.start) - 1
    links_patches = [surface_patches(surfaces, link) for link in range(links)]
    area = sum(float(patches.area.sum()) for patches in links_patches)
    edge = math.sqrt((area + unsearched_area) / SAMPLES)
    cells: list[Patches] = []
    subcells: list[Patches] = []
    subcell_counts: list[np.ndarray] = []
    for patches in links_patches:
        if not len(patches.area):
            continue
        count = max(round(float(patches.area.sum()) / edge**2), 1)
        whole = np.array([0, len(patches.area)])
        owner, counts = _assign_to_cells(patches, whole, edge, count)
        cells.append(_representatives(patches, owner, counts))
        by_cell = np.argsort(owner, kind="stable")
        patches = Patches(*(values[by_cell] for values in patches))
        start = np.concatenate(([0], np.cumsum(np.bincount(owner))))
        owner, counts = _assign_to_cells(patches, start, edge / math.sqrt(SUBSAMPLES), SUBSAMPLES)
        subcells.append(_representatives(patches, owner, counts))
        subcell_counts.append(counts)
    if not cells:
        return *_no_samples(len(surfaces.kind)), 1.0
    cell, subcell = (
        Patches(*(np.concatenate(values) for values in zip(*of_links, strict=True)))
        for of_links in (cells, subcells)
    )
    order = np.argsort(cell.primitive, kind="stable")
    start = np.searchsorted(cell.primitive[order], np.arange(len(surfaces.kind) + 1)).astype(np.int64)
    point, normal, primitive, spread, weight = (values[order] for values in cell)
    samples = SurfaceSamples(
        point, normal, spread, np.log(weight / area), np.zeros(len(spread)), primitive, start
    )
    counts = np.concatenate(subcell_counts)
    of_cell = np.repeat(np.argsort(order), counts)
    point, normal, primitive, spread, weight = (
        values[np.argsort(of_cell, kind="stable")] for values in subcell
    )
    first = np.concatenate(([0], np.cumsum(counts[order])))
    subsamples = SurfaceSubsamples(
        point, normal, spread, np.log(weight / area), np.zeros(len(spread)), primitive, first
    )
    return samples, subsamples, area


def _no_samples(primitives: int) -> tuple[SurfaceSamples, SurfaceSubsamples]:
    vectors, scalars = np.zeros((0, 3)), np.zeros(0)
    primitive, start = np.zeros(0, dtype=np.int64), np.zeros(primitives + 1, dtype=np.int64)
    return (
        SurfaceSamples(vectors, vectors, scalars, scalars, scalars, primitive, start),
        SurfaceSubsamples(vectors, vectors, scalars, scalars, scalars, primitive, start[:1]),
    )


def surface_patches(surfaces: Surfaces, link: int) -> Patches:
    """Surface points of a link with their areas; their spread is not set."""
    first, last = surfaces.start[link], surfaces.start[link + 1]
    if first == last:
        return Patches(
            np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0)
        )
    spacing = min(MAX_GRID_SPACING, RELATIVE_GRID_SPACING * float(surfaces.radius[first:last].max()))
    half_thickness = 1.5 * spacing
    reach = surfaces.radius[first:last, None] + half_thickness
    low = (surfaces.origin[first:last] - reach).min(axis=0)
    high = (surfaces.origin[first:last] + reach).max(axis=0)
    axes = [np.arange(low[i], high[i] + spacing, spacing) for i in range(3)]
    near = _blocks_near_surface(surfaces, link, axes, half_thickness)
    grid = np.stack([axis[indices] for axis, indices in zip(axes, np.nonzero(near), strict=True)], axis=-1)
    distance, primitive, normal = distances(surfaces, grid, link)
    in_shell = np.abs(distance) < half_thickness
    grid, distance, primitive, normal = (
        grid[in_shell],
        distance[in_shell],
        primitive[in_shell],
        normal[in_shell],
    )
    weight = spacing**3 * (1.0 + np.cos(np.pi * distance / half_thickness)) / (2.0 * half_thickness)
    point = grid - distance[:, None] * normal
    exposed = distances(surfaces, point, link)[0] > -spacing / 4
    if link == 0:
        exposed &= ~is_on_mounting_face(point, normal)
        # What stands at the base covers the same part of it in all postures.
        exposed &= cover_distances(surfaces, point) > -spacing / 4
    patches = Patches(point, normal, primitive.astype(np.int64), np.zeros(len(point)), weight)
    return Patches(*(values[exposed] for values in patches))


def is_on_mounting_face(point: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Whether points of the base link lie on the face that it stands on, which nothing can touch.

    Args:
        point: Base frame, shape (N, 3) [m].
        normal: Outward unit normals, shape (N, 3).
    """
    return (point[:, 2] <= MOUNTING_HEIGHT) & (normal[:, 2] <= -0.5)


def _blocks_near_surface(
    surfaces: Surfaces, link: int, axes: list[np.ndarray], distance: float
) -> np.ndarray:
    """Which points of a grid lie in blocks that come as near to a link's surface as `distance` [m], shape of
    the grid. A signed distance changes by at most the distance between two points, so the others do not."""
    spacing = float(axes[0][1] - axes[0][0])
    centres = [axis[::BLOCK] + 0.5 * (BLOCK - 1) * spacing for axis in axes]
    centre = np.stack(np.meshgrid(*centres, indexing="ij"), axis=-1)
    half_diagonal = 0.5 * math.sqrt(3.0) * (BLOCK - 1) * spacing
    near = np.abs(distances(surfaces, centre.reshape(-1, 3), link)[0]) < distance + 1.01 * half_diagonal
    points: np.ndarray = near.reshape(centre.shape[:3])
    for i in range(3):
        points = points.repeat(BLOCK, axis=i)
    return points[tuple(slice(len(axis)) for axis in axes)]


def cover_distances(surfaces: Surfaces, points: np.ndarray) -> np.ndarray:
    """Signed distances of points, base frame, shape (N, 3) [m], to the bodies that cover the arm, shape (N,)
    [m]; infinite without any."""
    covers = surfaces._replace(start=np.array([surfaces.start[-1], len(surfaces.kind)], dtype=np.int64))
    return distances(covers, points)[0]


def _assign_to_cells(
    patches: Patches, start: np.ndarray, edge: float, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Divide each of G groups of patches into up to `count` cells by farthest-point sampling in position and
    normal.

    A normal that differs by 90 degrees counts as a distance of `edge` [m], the size of a cell.

    Args:
        patches: Sorted by group.
        start: First patch of each group, then the total number, shape (G + 1,).
        edge: Size of a cell [m].
        count: Largest number of cells of one group.

    Returns:
        Index of the cell of each patch, shape (N,), int64, the cells of a group following those of the groups
        before; number of cells of each group, shape (G,), int64.
    """
    sizes = np.diff(start)
    group = np.repeat(np.arange(len(sizes)), sizes)
    centre = np.stack([np.bincount(group, column) / sizes for column in patches.point.T], axis=1)
    eccentricity = np.linalg.norm(patches.point - centre[group], axis=1)
    owner, counts = np.empty(len(group), dtype=np.int64), np.empty(len(sizes), dtype=np.int64)
    features, squared_distance = _features(patches, np.full(len(group), edge)), np.empty(len(group))
    farthest_points_of_groups(features, start, eccentricity, count, squared_distance, owner, counts)
    return owner + (np.cumsum(counts) - counts)[group], counts


def _features(patches: Patches, edge: np.ndarray) -> np.ndarray:
    return np.hstack((patches.point, patches.normal * (edge / math.sqrt(2.0))[:, None]))


def _representatives(patches: Patches, owner: np.ndarray, counts: np.ndarray) -> Patches:
    """Each cell as one patch: the member nearest to its centre, the area, and the spread of the members.

    `owner`, `counts`: as `_assign_to_cells` returns them.
    """
    area = np.bincount(owner, patches.area)
    group = np.repeat(np.arange(len(counts)), counts)
    edge = np.sqrt(np.bincount(group, area) / counts)
    feature = _features(patches, edge[group[owner]])
    centre = np.stack([np.bincount(owner, patches.area * column) / area for column in feature.T], axis=1)
    squared_distance = ((feature - centre[owner]) ** 2).sum(axis=1)
    best = np.full(len(area), -1)
    _nearest_members(squared_distance, owner, best)
    displacement = patches.point - patches.point[best][owner]
    along_normal = (displacement * patches.normal[best][owner]).sum(axis=1)
    # Rounding could make it negative.
    tangential = np.maximum((displacement**2).sum(axis=1) - along_normal**2, 0.0)
    spread = np.sqrt(np.bincount(owner, patches.area * tangential) / area / 2.0)
    spread = np.maximum(spread, np.sqrt(area / 12.0) / 2.0)
    return Patches(patches.point[best], patches.normal[best], patches.primitive[best], spread, area)


@kernel
def _nearest_members(squared_distance: np.ndarray, owner: np.ndarray, best: np.ndarray) -> None:
    """Fill `best`, -1 so far, with the member of each cell that is nearest to its centre, the earlier one if
    two are equally near."""
    for i in range(owner.shape[0]):
        cell = owner[i]
        if best[cell] < 0 or squared_distance[i] < squared_distance[best[cell]]:
            best[cell] = i
