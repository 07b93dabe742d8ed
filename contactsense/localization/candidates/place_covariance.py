"""Covariance of a place on a surface: along two tangents, or as a matrix in the axes of a frame; and second
moments of places about a point."""

from contactsense.kinematics.spatial import Six
from contactsense.kinematics.wrench_information import symmetric_matvec
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.vectors import Vector, dot
from contactsense.solvers.posterior.friction_tails import Variances

Tangents = tuple[Vector, Vector]
"""Two orthogonal unit vectors along a surface."""


@fused_kernel
def from_tangents(variances: Variances, tangents: Tangents) -> Six:
    """The matrix (xx, xy, xz, yy, yz, zz) of a covariance along two tangents."""
    (v11, v12, v22), (s, t) = variances, tangents
    a = (v11 * s[0] + v12 * t[0], v11 * s[1] + v12 * t[1], v11 * s[2] + v12 * t[2])
    b = (v12 * s[0] + v22 * t[0], v12 * s[1] + v22 * t[1], v12 * s[2] + v22 * t[2])
    return (
        a[0] * s[0] + b[0] * t[0],
        a[0] * s[1] + b[0] * t[1],
        a[0] * s[2] + b[0] * t[2],
        a[1] * s[1] + b[1] * t[1],
        a[1] * s[2] + b[1] * t[2],
        a[2] * s[2] + b[2] * t[2],
    )


@fused_kernel
def along_tangents(C: Six, tangents: Tangents) -> Variances:
    """The covariance along two tangents of a matrix C (xx, xy, xz, yy, yz, zz)."""
    s, t = tangents
    a, b = symmetric_matvec(C, s), symmetric_matvec(C, t)
    return dot(s, a), dot(t, a), dot(t, b)


@fused_kernel
def about_another_point(moments: Six, mean: Vector, offset: Vector) -> Six:
    """Second moments of places (xx, xy, xz, yy, yz, zz) about another point.

    Args:
        moments: Those about the first point [m^2].
        mean: Mean of the places, from the first point [m].
        offset: The other point, from the first [m].
    """
    (mx, my, mz), (x, y, z) = mean, offset
    return (
        moments[0] - 2.0 * mx * x + x * x,
        moments[1] - mx * y - my * x + x * y,
        moments[2] - mx * z - mz * x + x * z,
        moments[3] - 2.0 * my * y + y * y,
        moments[4] - my * z - mz * y + y * z,
        moments[5] - 2.0 * mz * z + z * z,
    )
