"""Signed distance from the mean surface of a primitive, see
`contactsense.localization.surface.mean_surface`."""

from contactsense.localization.surface.local_prior import DeviationCells, nearest_cell
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.surface.convex_primitives import Surfaces, project
from contactsense.robots.vectors import Vector, rotate_back, subtract, vector


@fused_kernel
def mean_surface_distance(surfaces: Surfaces, cells: DeviationCells, p: int, point: Vector) -> float:
    """Signed distance of a point from the mean surface of primitive p [m], in the cell that is nearest to it.

    Args:
        surfaces: Primitives.
        cells: Their cells.
        p: The primitive.
        point: The point, body frame of the primitive [m].
    """
    kind, size = surfaces.kind[p], surfaces.size[p]
    x, y, z = point
    distance, px, py, pz, _, _, _ = project(kind, size, x, y, z)
    if cells.displacement[p] == 0.0:
        return distance
    i = nearest_cell(cells, p, px, py, pz)
    # Moving the surface is moving the point the other way.
    x, y, z = rotate_back(cells.rotation[i], subtract(point, vector(cells.translation[i])))
    moved: float = project(kind, size, x, y, z)[0]
    return moved
