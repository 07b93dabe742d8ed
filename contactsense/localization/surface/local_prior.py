"""Prior of a contact at one place: how far the real surface is from the primitives there.

On a plain face it is a tenth of a millimetre, at ribs, edges and recesses some millimetres, and there the
real normal is tilted: the force seems inclined by more than friction permits. Cells of the primitives'
surface hold both, as measured on the meshes (`contactsense.robots.decomposition.local_deviation`).
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from contactsense.robots.jit.declaration import Floats, Integers
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.solvers.posterior.contact_prior import Prior, with_surface

TILT_LENGTH = 0.0035
"""Ratio of the real surface's offset from a primitive to its tilt [m], where no cell has measured the tilt.

Both are standard deviations of normal distributions with the measured 90th percentiles (`contactsense
bench geometry --json`: 0.8 mm and 16 to 19 degrees).
"""
MAX_TILT = 0.33
"""Upper bound of that tilt, as measured on the `coarse` primitives (36 to 44 degrees) [rad]."""

LONG_TAILS = 1.1
"""Factor on the root mean squares of a cell in the search: distances and tilts have longer tails than a
Gaussian. The value is not critical: from 1 to 1.3 the log scores of answers differ by less than 3 % on
average (`contactsense bench calibration --json`: UR3e and UR5e of own truth, `--seed 11`, first half of the
given UR10e, without noise and at 0.05 N)."""


class SurfaceError(NamedTuple):
    """How far the real surface is from the primitives at one place."""

    offset: float
    """Standard deviation of the offset along the normal [m]."""
    tilt: float
    """Standard deviation of the angle between the normals along each tangent [rad]."""
    tails: float
    """Factor of both on the root mean squares of the surface."""


class DeviationCells(NamedTuple):
    """D cells of the surface of the primitives, sorted by primitive; body frames of the primitives."""

    point: Annotated[Floats, "deviations, 3"]
    """Centre [m]; a place belongs to the nearest one on its primitive."""
    ratio: Annotated[Floats, "deviations"]
    """Standard deviation of the surface's offset over `Prior.surface_deviation`."""
    tilt: Annotated[Floats, "deviations"]
    """Standard deviation of the angle between the normals along each tangent [rad]."""
    start: Annotated[Integers, "primitives + 1"]
    """First cell of each primitive, then the total number. A primitive without cells has ratio 1, tilt 0."""
    largest: Annotated[Floats, "primitives"]
    """Largest ratio on each primitive."""
    rotation: Annotated[Floats, "deviations, 3, 3"]
    """Motion of the primitive's surface to where the real one is on average
    (`contactsense.localization.surface.mean_surface`): rotation about the origin ..."""
    translation: Annotated[Floats, "deviations, 3"]
    """... then translation [m]."""
    mean_point: Annotated[Floats, "deviations, 3"]
    """The point of the moved surface at the cell's centre [m]."""
    mean_normal: Annotated[Floats, "deviations, 3"]
    """Its outward unit normal there."""
    displacement: Annotated[Floats, "primitives"]
    """Largest displacement of points in the cells of each primitive [m]; 0: its surface is not moved."""
    largest_displacement: float
    """Largest displacement of all [m]; 0: no surface is moved."""


@fused_kernel
def nearest_cell(cells: DeviationCells, p: int, x: float, y: float, z: float) -> int:
    """Cell to which the point (x, y, z) of primitive p belongs, body frame [m]; -1 if the primitive has
    none."""
    nearest, least = -1, math.inf
    for i in range(cells.start[p], cells.start[p + 1]):
        dx, dy, dz = cells.point[i, 0] - x, cells.point[i, 1] - y, cells.point[i, 2] - z
        squared = dx * dx + dy * dy + dz * dz
        if squared < least:
            nearest, least = i, squared
    return nearest


@fused_kernel
def prior_in_cell(prior: Prior, cells: DeviationCells, i: int) -> Prior:
    """The prior in cell i; without change for -1.

    The friction ratio is that of the force to the primitive's normal: the variance of the tilt adds to it.
    """
    if i < 0:
        return prior
    tilt = cells.tilt[i]
    ratio = math.sqrt(prior.friction_ratio * prior.friction_ratio + tilt * tilt)
    changed: Prior = with_surface(prior, ratio, prior.surface_deviation * cells.ratio[i])
    return changed


@fused_kernel
def tilt_in_cell(prior: Prior, cells: DeviationCells, i: int) -> float:
    """Standard deviation of the angle between the normals of surface and primitive along each tangent in cell
    i [rad]; -1: where there is no cell."""
    if i < 0:
        return min(prior.surface_deviation / TILT_LENGTH, MAX_TILT)
    tilt: float = cells.tilt[i]
    return tilt


@fused_kernel
def surface_error_in_cell(prior: Prior, cells: DeviationCells, i: int) -> SurfaceError:
    """Error of the surface in cell i; -1: where there is no cell, so that no tails are measured."""
    tilt = tilt_in_cell(prior, cells, i)
    if i < 0:
        return SurfaceError(prior.surface_deviation, tilt, 1.0)
    return SurfaceError(prior.surface_deviation * cells.ratio[i], tilt, LONG_TAILS)


def no_cells(primitives: int) -> DeviationCells:
    """Cells of a surface that is equally well known everywhere."""
    return DeviationCells(
        point=np.zeros((0, 3)),
        ratio=np.zeros(0),
        tilt=np.zeros(0),
        start=np.zeros(primitives + 1, np.int64),
        largest=np.ones(primitives),
        rotation=np.zeros((0, 3, 3)),
        translation=np.zeros((0, 3)),
        mean_point=np.zeros((0, 3)),
        mean_normal=np.zeros((0, 3)),
        displacement=np.zeros(primitives),
        largest_displacement=0.0,
    )
