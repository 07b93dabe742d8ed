"""Scale of a candidate's covariance, so that its ellipse of 90 % holds 90 % of the probability.

From torques alone a place is often known no better than "anywhere on this side of the link": the density is
flat up to the link's ends, and an ellipse from its second moments holds more than a Gaussian's would. How
much more is measured by Mardia's kurtosis, the mean fourth power of the distance in standard deviations (K.
V. Mardia, "Measures of multivariate skewness and kurtosis with applications", 1970): 8 for a Gaussian on a
plane, 16/3 for a uniform ellipse.
"""

from contactsense.kinematics.spatial import Six
from contactsense.localization.surface_cells import SurfaceCells
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.vectors import Vector, dot, tangents
from contactsense.solvers.posterior.region import REGION_90

GAUSSIAN_KURTOSIS = 8.0
"""Mean fourth power of the distance for a Gaussian on a plane."""
SLOPE = (1.0 - 3.6 / REGION_90) / (8.0 - 16.0 / 3.0)
"""Decrease of the scale for each unit of missing kurtosis. Exact for the uniform ellipse, 90 % of which is
within a squared distance of 3.6, that of a Gaussian within `REGION_90`."""
LEAST_SCALE = 0.6
"""Lower bound of the scale: two separate places are less than flat, and have no ellipse."""


@fused_kernel
def ellipse_scale(cells: SurfaceCells, rows: int, point: Vector, normal: Vector, C: Six) -> float:
    """Factor on the covariance of a candidate along the surface, at most 1.

    Args:
        cells: Cells; those of the candidate have a positive `weight`.
        rows: Number of cells.
        point: Place of the candidate, link frame [m].
        normal: Outward unit normal there.
        C: Second moments about it (xx, xy, xz, yy, yz, zz) [m^2].
    """
    t1, t2 = tangents(normal)
    c1, c2 = _times(C, t1), _times(C, t2)
    v11, v12, v22 = dot(t1, c1), dot(t1, c2), dot(t2, c2)
    det = v11 * v22 - v12 * v12
    if not det > 0.0:
        return 1.0
    # Inverse of the covariance along the tangents.
    i11, i12, i22 = v22 / det, -v12 / det, v11 / det
    squares = i11 * i11 + 2.0 * i12 * i12 + i22 * i22
    total, fourth = 0.0, 0.0
    for i in range(rows):
        weight = cells.weight[i]
        if weight <= 0.0:
            continue
        d = (cells.point[i, 0] - point[0], cells.point[i, 1] - point[1], cells.point[i, 2] - point[2])
        a, b = dot(t1, d), dot(t2, d)
        u, w, v = i11 * a + i12 * b, i12 * a + i22 * b, cells.variance[i]
        # A Gaussian of variance v in each cell.
        second = a * u + b * w + v * (i11 + i22)
        fourth += weight * (second * second + 4.0 * v * (u * u + w * w) + 2.0 * v * v * squares)
        total += weight
    kurtosis = fourth / total
    return min(max(1.0 - SLOPE * (GAUSSIAN_KURTOSIS - kurtosis), LEAST_SCALE), 1.0)


@fused_kernel
def scaled_along_surface(C: Six, normal: Vector, factor: float) -> Six:
    """C (xx, xy, xz, yy, yz, zz) times a factor, but for the variance along the normal: how far a place lies
    below the tangent plane, as on the far side of a link, is as uncertain as before."""
    x, y, z = normal
    kept = (1.0 - factor) * dot(normal, _times(C, normal))
    return (
        factor * C[0] + kept * x * x,
        factor * C[1] + kept * x * y,
        factor * C[2] + kept * x * z,
        factor * C[3] + kept * y * y,
        factor * C[4] + kept * y * z,
        factor * C[5] + kept * z * z,
    )


@fused_kernel
def _times(C: Six, a: Vector) -> Vector:
    """C a for a symmetric matrix."""
    return (
        C[0] * a[0] + C[1] * a[1] + C[2] * a[2],
        C[1] * a[0] + C[3] * a[1] + C[4] * a[2],
        C[2] * a[0] + C[4] * a[1] + C[5] * a[2],
    )
