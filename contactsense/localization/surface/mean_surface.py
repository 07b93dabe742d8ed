"""Where the real surface is on average, if the primitives are too coarse to be there.

A coarse primitive passes centimetres below a whole housing or above a whole waist, and leans from it by tens
of degrees. That is no chance: it is the same for all contacts there. So in each cell of its surface
(`contactsense.localization.surface.local_prior.DeviationCells`) the primitive is moved to the mean of the
skin; what remains is the cell's standard deviation. A contact is sought on the primitive as moved in the cell
that the line of action enters, by the same search: only the body frame differs. Other primitives cover it
where their own mean surfaces are.
"""

import math
from typing import TypeVar

import numpy as np

from contactsense.localization.surface.local_prior import DeviationCells, nearest_cell
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.localization.surface.primitive_frames import Frame
from contactsense.localization.surface.surface_samples import SurfaceSamples, SurfaceSubsamples
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.robots.vectors import cross, divide, dot, norm, subtract, vector
from contactsense.solvers.posterior.contact_prior import STUDENT_DOF

CELL_SPREAD = 0.0081
"""Standard deviation of places in a cell along each tangent [m]: a square of 28 mm, see
`contactsense.robots.decomposition.local_deviation.MOVED_CELL`."""
LEAST_PUSH = 0.05
"""A force whose cosine to the inward normal is smaller than this does not push on a cell."""
S = TypeVar("S", SurfaceSamples, SurfaceSubsamples)


@fused_kernel
def entered_cell(cells: DeviationCells, p: int, w: np.ndarray, friction_ratio: float) -> int:
    """Cell of primitive p in which the line of action most probably enters the mean surface.

    The place is normally distributed about the cell's centre; the force is inclined as
    `contactsense.solvers.posterior.contact_prior` assumes, with the tilt that remains.

    Args:
        cells: The cells; the primitive has some.
        p: The primitive.
        w: Wrench in the primitive's own body frame, shape (6,) [N, Nm].
        friction_ratio: As in `Prior`.
    """
    force, moment = (w[0], w[1], w[2]), (w[3], w[4], w[5])
    magnitude = norm(force)
    best, least = int(cells.start[p]), math.inf
    if magnitude == 0.0:
        return best
    direction = divide(force, magnitude)
    for i in range(cells.start[p], cells.start[p + 1]):
        push = -dot(direction, vector(cells.mean_normal[i]))
        if push <= LEAST_PUSH:
            continue
        # Moment about the centre, over the force: the distance of the line, and a part along the force.
        lever = divide(subtract(moment, cross(vector(cells.mean_point[i]), force)), magnitude)
        along = dot(lever, direction)
        squared_distance = dot(lever, lever) - along * along
        tilt = cells.tilt[i]
        squared_ratio = (1.0 / (push * push) - 1.0) / (friction_ratio * friction_ratio + tilt * tilt)
        energy = 0.5 * (
            squared_distance / (CELL_SPREAD * CELL_SPREAD)
            + (STUDENT_DOF + 2.0) * math.log(1.0 + squared_ratio / STUDENT_DOF)
        )
        if energy < least:
            best, least = i, energy
    return best


@fused_kernel
def mean_frame(surface: PlacedSurface, p: int, i: int) -> Frame:
    """Body frame of primitive p as moved in cell i, base frame.

    If its surface is not moved, it is the primitive's own. Otherwise its arrays are scratch, valid until the
    next call.
    """
    cells, frames = surface.deviations, surface.frames
    R, o = frames.rotation[p], frames.origin[p]
    if cells.displacement[p] == 0.0:
        return Frame(R, o)
    Q, t = cells.rotation[i], cells.translation[i]
    rotation, origin = frames.mean_rotation, frames.mean_origin
    for k in range(3):
        x, y, z = R[k, 0], R[k, 1], R[k, 2]
        origin[k] = o[k] + x * t[0] + y * t[1] + z * t[2]
        for j in range(3):
            rotation[k, j] = x * Q[0, j] + y * Q[1, j] + z * Q[2, j]
    return Frame(rotation, origin)


def with_deviations(samples: S, surfaces: Surfaces, cells: DeviationCells) -> S:
    """Samples of the primitives' surface with the deviations of their cells: on the mean surface, with its
    tilt; link frames."""
    point, normal, tilt = samples.point.copy(), samples.normal.copy(), samples.tilt.copy()
    has_cells = np.diff(cells.start) > 0
    for s in np.flatnonzero(has_cells[samples.primitive]):
        p = int(samples.primitive[s])
        R, o = surfaces.rotation[p], surfaces.origin[p]
        local = R.T @ (point[s] - o)
        i = nearest_cell(cells, p, *local)
        tilt[s] = cells.tilt[i]
        if cells.displacement[p] == 0.0:
            continue
        point[s] = R @ (cells.rotation[i] @ local + cells.translation[i]) + o
        normal[s] = R @ (cells.rotation[i] @ (R.T @ normal[s]))
    return samples._replace(point=point, normal=normal, tilt=tilt)
