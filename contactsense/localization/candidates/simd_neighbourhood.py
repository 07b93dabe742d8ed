"""How much of a candidate's neighbourhood other primitives cover: a quadrature whose points are processed
with SIMD instructions, one in each lane.

The scratch array is flat: quantity Q of point j is at index Q + j. Loops over j are vectorized by the
compiler as long as they contain arithmetic only.
"""

import math

import numpy as np

from contactsense.kinematics.spatial import Six
from contactsense.kinematics.wrench_information import Block, matvec, transposed_matvec
from contactsense.localization.surface.mean_surface_distance import mean_surface_distance
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.localization.surface.primitive_frames import Frame
from contactsense.robots.jit.kernel import fused_kernel, inlined_fused_kernel
from contactsense.robots.surface.convex_primitives import REVOLVED, project
from contactsense.robots.surface.simd_revolved import profile, project_revolved
from contactsense.robots.vectors import Vector, add, add_scaled, subtract, vector
from contactsense.solvers.posterior.contact_prior import STUDENT_DOF

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

X, Y, Z, NX, NY, NZ, COVER = range(0, 7 * POINTS, POINTS)
"""Offsets of a point's quantities. `X` to `NZ`: the point on the surface and the normal there. `COVER`:
distance of the place above it from the nearest primitive, if it is inside one, else 0 [m]."""
LENGTH = 7 * POINTS
"""Length of the scratch array."""


@fused_kernel
def spread_points(
    kind: int,
    size: np.ndarray,
    frame: Frame,
    c: Vector,
    axes: tuple[Vector, Vector],
    points: np.ndarray,
) -> None:
    """Put the quadrature's points about a point of a primitive's surface into the scratch array, base frame.

    Args:
        kind, size, frame: The primitive and its body frame in the base frame.
        c: The point, base frame [m].
        axes: Root of its covariance: vectors tangential to the surface [m]. The points are at
            c + u1 axes[0] + u2 axes[1], moved to the nearest place on the surface.
        points: Filled.
    """
    body_axes, origin = _axes(frame.rotation), vector(frame.origin)
    # In the body frame.
    start = matvec(body_axes, subtract(c, origin))
    first, second = matvec(body_axes, axes[0]), matvec(body_axes, axes[1])
    if kind == REVOLVED:
        body = profile(size[0], size[1], size[2], size[3])
        for j in range(POINTS):
            place = add_scaled(add_scaled(start, _U1[j], first), _U2[j], second)
            _, x, y, z, nx, ny, nz = project_revolved(body, *place)
            points[X + j], points[Y + j], points[Z + j] = x, y, z
            points[NX + j], points[NY + j], points[NZ + j] = nx, ny, nz
    else:
        for j in range(_POINTS):
            place = add_scaled(add_scaled(start, _U1[j], first), _U2[j], second)
            _, x, y, z, nx, ny, nz = project(kind, size, *place)
            points[X + j], points[Y + j], points[Z + j] = x, y, z
            points[NX + j], points[NY + j], points[NZ + j] = nx, ny, nz
    for j in range(POINTS):
        point = transposed_matvec(body_axes, (points[X + j], points[Y + j], points[Z + j]))
        normal = transposed_matvec(body_axes, (points[NX + j], points[NY + j], points[NZ + j]))
        points[X + j], points[Y + j], points[Z + j] = add(origin, point)
        points[NX + j], points[NY + j], points[NZ + j] = normal
        points[COVER + j] = 0.0


@fused_kernel
def cover_points(surface: PlacedSurface, p: int, height: float, points: np.ndarray) -> None:
    """Lower `COVER` where places above the points are inside the mean surface of primitive p.

    Args:
        surface: Where all primitives are.
        p: The primitive.
        height: Of the places above the surface [m].
        points: The scratch array.
    """
    surfaces, deviations, frames = surface
    body_axes, origin = _axes(frames.rotation[p]), vector(frames.origin[p])
    size = surfaces.size[p]
    if surfaces.kind[p] == REVOLVED and deviations.displacement[p] == 0.0:
        body = profile(size[0], size[1], size[2], size[3])
        for j in range(POINTS):
            place = matvec(body_axes, subtract(_above(points, j, height), origin))
            distance = project_revolved(body, *place)[0]
            points[COVER + j] = min(points[COVER + j], distance)
    else:
        for j in range(_POINTS):
            place = matvec(body_axes, subtract(_above(points, j, height), origin))
            distance = mean_surface_distance(surfaces, deviations, p, place)
            points[COVER + j] = min(points[COVER + j], distance)


@inlined_fused_kernel
def _above(points: np.ndarray, j: int, height: float) -> Vector:
    """The place `height` above point j, base frame [m]."""
    normal = (points[NX + j], points[NY + j], points[NZ + j])
    return add_scaled((points[X + j], points[Y + j], points[Z + j]), height, normal)


@inlined_fused_kernel
def _axes(R: np.ndarray) -> Block:
    """The axes of a body frame, the columns of R, as rows; read before anything is written, as the compiler
    must assume that arrays overlap."""
    return (R[0, 0], R[1, 0], R[2, 0]), (R[0, 1], R[1, 1], R[2, 1]), (R[0, 2], R[1, 2], R[2, 2])


@inlined_fused_kernel
def tail_of_penetration(depth: float, scale: float) -> float:
    """Probability that a place can be touched although it is inside another body by `depth` [m]; 1 for none.

    It falls with the tail of a Student t distribution of that scale [m], because the surfaces are uncertain.
    """
    penetration = depth / scale
    ratio = 1.0 / (1.0 + penetration * penetration / STUDENT_DOF)
    # To the power of (nu + 1) / 2, for nu = 4.
    return ratio * ratio * math.sqrt(ratio)


@fused_kernel
def accessible_moments(c: Vector, scale: float, points: np.ndarray) -> tuple[float, Vector, Six]:
    """Moments of the distribution of the points, as far as they are accessible.

    Args:
        c: The point about which they are spread [m].
        scale: Of the tolerated penetration, see `tail_of_penetration` [m].
        points: The scratch array.

    Returns:
        Accessible share; mean displacement from c [m] and second moments about c (xx, xy, xz, yy, yz, zz)
        [m^2], both times the share.
    """
    cx, cy, cz = c
    share, mx, my, mz = 0.0, 0.0, 0.0, 0.0
    xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(POINTS):
        x, y, z = points[X + j] - cx, points[Y + j] - cy, points[Z + j] - cz
        weight = _WEIGHT[j] * tail_of_penetration(points[COVER + j], scale)
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
