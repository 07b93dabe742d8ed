"""How much of a candidate's neighbourhood other primitives cover: a quadrature whose points are processed
with SIMD instructions, one in each lane.

The scratch array is flat: quantity Q of point j is at index Q + j. Loops over j are vectorized by the
compiler as long as they contain arithmetic only.
"""

import math

import numpy as np

from contactsense.kinematics.spatial import Six
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.surface.convex_primitives import REVOLVED, project
from contactsense.robots.surface.simd_revolved import profile, project_revolved
from contactsense.robots.vectors import Vector
from contactsense.solvers.posterior import STUDENT_DOF

QUADRATURE_RINGS = ((0.91195, 0.71109 / 6), (2.14213, 0.27852 / 6), (3.54680, 0.010389 / 6))
"""Radii (in standard deviations) and weights of a quadrature for a normal distribution on a plane.

Six points on each of three rings (Gauss-Laguerre in half the squared radius).
"""
_ANGLES = np.pi / 3.0 * np.arange(6)
QUADRATURE_POINTS = np.array(
    [(radius * np.cos(a), radius * np.sin(a)) for radius, _ in QUADRATURE_RINGS for a in _ANGLES]
)
"""The points, shape (18, 2)."""
QUADRATURE_WEIGHTS = np.repeat([weight for _, weight in QUADRATURE_RINGS], len(_ANGLES))
"""Their weights, shape (18,)."""
_POINTS = len(QUADRATURE_WEIGHTS)
POINTS = 24
"""Points of the scratch array: those of the quadrature, and some of weight zero, so that lanes are full."""
_U1, _U2, _WEIGHT = (
    np.pad(column, (0, POINTS - _POINTS)) for column in (*QUADRATURE_POINTS.T, QUADRATURE_WEIGHTS)
)

X, Y, Z, NX, NY, NZ, AX, AY, AZ, COVER = range(0, 10 * POINTS, POINTS)
"""Offsets of a point's quantities. `X` to `NZ`: the point on the surface and the normal there; `AX` to
`AZ`: the point above it, at the height that a touching object needs [m]. `COVER`: distance of the latter
from the nearest primitive, if it is inside one, else 0 [m]."""
LENGTH = 10 * POINTS
"""Length of the scratch array."""


@fused_kernel
def spread_points(
    kind: int,
    size: np.ndarray,
    R: np.ndarray,
    o: np.ndarray,
    c: Vector,
    axes: tuple[Vector, Vector],
    height: float,
    points: np.ndarray,
) -> None:
    """Put the quadrature's points about a point of a primitive's surface into the scratch array, base frame.

    Args:
        kind, size, R, o: The primitive and its body frame in the base frame.
        c: The point, base frame [m].
        axes: Root of its covariance: vectors tangential to the surface [m]. The points are at
            c + u1 axes[0] + u2 axes[1], moved to the nearest place on the surface.
        height: Of the points above the surface [m].
        points: Filled.
    """
    (ax, ay, az), (bx, by, bz) = axes
    r00, r01, r02 = R[0, 0], R[0, 1], R[0, 2]
    r10, r11, r12 = R[1, 0], R[1, 1], R[1, 2]
    r20, r21, r22 = R[2, 0], R[2, 1], R[2, 2]
    ox, oy, oz = o[0], o[1], o[2]
    sx, sy, sz = c[0] - ox, c[1] - oy, c[2] - oz
    if kind == REVOLVED:
        body = profile(size[0], size[1], size[2], size[3])
        for j in range(POINTS):
            u1, u2 = _U1[j], _U2[j]
            dx, dy, dz = sx + u1 * ax + u2 * bx, sy + u1 * ay + u2 * by, sz + u1 * az + u2 * bz
            _, x, y, z, nx, ny, nz = project_revolved(
                body,
                r00 * dx + r10 * dy + r20 * dz,
                r01 * dx + r11 * dy + r21 * dz,
                r02 * dx + r12 * dy + r22 * dz,
            )
            points[X + j], points[Y + j], points[Z + j] = x, y, z
            points[NX + j], points[NY + j], points[NZ + j] = nx, ny, nz
    else:
        for j in range(_POINTS):
            u1, u2 = _U1[j], _U2[j]
            dx, dy, dz = sx + u1 * ax + u2 * bx, sy + u1 * ay + u2 * by, sz + u1 * az + u2 * bz
            _, x, y, z, nx, ny, nz = project(
                kind,
                size,
                r00 * dx + r10 * dy + r20 * dz,
                r01 * dx + r11 * dy + r21 * dz,
                r02 * dx + r12 * dy + r22 * dz,
            )
            points[X + j], points[Y + j], points[Z + j] = x, y, z
            points[NX + j], points[NY + j], points[NZ + j] = nx, ny, nz
    for j in range(POINTS):
        x, y, z = points[X + j], points[Y + j], points[Z + j]
        nx, ny, nz = points[NX + j], points[NY + j], points[NZ + j]
        px, py, pz = (
            ox + r00 * x + r01 * y + r02 * z,
            oy + r10 * x + r11 * y + r12 * z,
            oz + r20 * x + r21 * y + r22 * z,
        )
        points[X + j], points[Y + j], points[Z + j] = px, py, pz
        points[AX + j] = px + height * (r00 * nx + r01 * ny + r02 * nz)
        points[AY + j] = py + height * (r10 * nx + r11 * ny + r12 * nz)
        points[AZ + j] = pz + height * (r20 * nx + r21 * ny + r22 * nz)
        points[COVER + j] = 0.0


@fused_kernel
def cover_points(kind: int, size: np.ndarray, R: np.ndarray, o: np.ndarray, points: np.ndarray) -> None:
    """Lower `COVER` where the points above the surface are inside a primitive, of body frame R, o."""
    r00, r01, r02 = R[0, 0], R[0, 1], R[0, 2]
    r10, r11, r12 = R[1, 0], R[1, 1], R[1, 2]
    r20, r21, r22 = R[2, 0], R[2, 1], R[2, 2]
    ox, oy, oz = o[0], o[1], o[2]
    if kind == REVOLVED:
        body = profile(size[0], size[1], size[2], size[3])
        for j in range(POINTS):
            dx, dy, dz = points[AX + j] - ox, points[AY + j] - oy, points[AZ + j] - oz
            distance = project_revolved(
                body,
                r00 * dx + r10 * dy + r20 * dz,
                r01 * dx + r11 * dy + r21 * dz,
                r02 * dx + r12 * dy + r22 * dz,
            )[0]
            points[COVER + j] = min(points[COVER + j], distance)
    else:
        for j in range(_POINTS):
            dx, dy, dz = points[AX + j] - ox, points[AY + j] - oy, points[AZ + j] - oz
            distance = project(
                kind,
                size,
                r00 * dx + r10 * dy + r20 * dz,
                r01 * dx + r11 * dy + r21 * dz,
                r02 * dx + r12 * dy + r22 * dz,
            )[0]
            points[COVER + j] = min(points[COVER + j], distance)


@fused_kernel
def accessible_moments(c: Vector, scale: float, points: np.ndarray) -> tuple[float, Vector, Six]:
    """Moments of the distribution of the points, as far as they are accessible.

    Args:
        c: The point about which they are spread [m].
        scale: Of the tolerated penetration [m], see
            `contactsense.localization.accessibility.accessible_share`.
        points: The scratch array.

    Returns:
        Accessible share; mean displacement from c [m] and second moments about c (xx, xy, xz, yy, yz, zz)
        [m^2], both times the share.
    """
    cx, cy, cz = c
    inverse = 1.0 / (scale * scale * STUDENT_DOF)
    share, mx, my, mz = 0.0, 0.0, 0.0, 0.0
    xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(POINTS):
        x, y, z = points[X + j] - cx, points[Y + j] - cy, points[Z + j] - cz
        ratio = 1.0 / (1.0 + points[COVER + j] * points[COVER + j] * inverse)
        weight = _WEIGHT[j] * ratio * ratio * math.sqrt(ratio)
        share += weight
        mx += weight * x
        my += weight * y
        mz += weight * z
        xx += weight * x * x
        xy += weight * x * y
        xz += weight * x * z
        yy += weight * y * y
        yz += weight * y * z
        zz += weight * z * z
    return share, (mx, my, mz), (xx, xy, xz, yy, yz, zz)
