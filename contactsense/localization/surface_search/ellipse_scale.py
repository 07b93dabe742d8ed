"""Scale of a candidate's covariance, so that its ellipse of 90 % holds 90 % of the probability.

From torques alone a place is often known no better than "anywhere on this side of the link": the density is
flat up to the link's ends, and an ellipse from its second moments holds more than a Gaussian's would. How
much more is measured by Mardia's kurtosis, the mean fourth power of the distance in standard deviations (K.
V. Mardia, "Measures of multivariate skewness and kurtosis with applications", 1970): 8 for a Gaussian on a
plane, 16/3 for a uniform ellipse.
"""

from contactsense.kinematics.spatial import Six
from contactsense.kinematics.wrench_information import symmetric_matvec
from contactsense.localization.candidates.place_covariance import along_tangents
from contactsense.localization.problem.surface_cells import SurfaceCells
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
    v11, v12, v22 = along_tangents(C, (t1, t2))
    det = v11 * v22 - v12 * v12
    if not det > 0.0:
        return 1.0
    # Inverse of the covariance along the tangents.
    i11, i12, i22 = v22 / det, -v12 / det, v11 / det
    total, fourth = 0.0, 0.0
    for i in range(rows):
        weight = cells.weight[i]
        if weight <= 0.0:
            continue
        d = (cells.point[i, 0] - point[0], cells.point[i, 1] - point[1], cells.point[i, 2] - point[2])
        a, b = dot(t1, d), dot(t2, d)
        u, w = i11 * a + i12 * b, i12 * a + i22 * b
        # A Gaussian of covariance V in each cell; M = I V.
        V = cells.covariance[i]
        v11, v12, v22 = along_tangents((V[0], V[1], V[2], V[3], V[4], V[5]), (t1, t2))
        m11, m12 = i11 * v11 + i12 * v12, i11 * v12 + i12 * v22
        m21, m22 = i12 * v11 + i22 * v12, i12 * v12 + i22 * v22
        second = a * u + b * w + m11 + m22
        spread = u * (v11 * u + v12 * w) + w * (v12 * u + v22 * w)
        squares = m11 * m11 + 2.0 * m12 * m21 + m22 * m22
        fourth += weight * (second * second + 4.0 * spread + 2.0 * squares)
        total += weight
    kurtosis = fourth / total
    return min(max(1.0 - SLOPE * (GAUSSIAN_KURTOSIS - kurtosis), LEAST_SCALE), 1.0)


@fused_kernel
def scaled_along_surface(C: Six, normal: Vector, factor: float) -> Six:
    """C (xx, xy, xz, yy, yz, zz) times a factor, but for the variance along the normal: how far a place lies
    below the tangent plane, as on the far side of a link, is as uncertain as before."""
    x, y, z = normal
    kept = (1.0 - factor) * dot(normal, symmetric_matvec(C, normal))
    return (
        factor * C[0] + kept * x * x,
        factor * C[1] + kept * x * y,
        factor * C[2] + kept * x * z,
        factor * C[3] + kept * y * y,
        factor * C[4] + kept * y * z,
        factor * C[5] + kept * z * z,
    )
