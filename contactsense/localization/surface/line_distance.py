"""How far spheres about parts of a link are from the line of action, in units of its uncertainty: several at
a time with SIMD instructions.

Most parts of the surface are far from the line. The spheres tell, so that these parts are not searched.
"""

import math

import numpy as np

from contactsense.kinematics.spatial import Six
from contactsense.robots.jit.kernel import fused_kernel, inlined_fused_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.vectors import Vector

CENTRE_X, CENTRE_Y, CENTRE_Z, RADIUS, OFFSET, SHIFT_ENERGY = range(0, 6 * LANES, LANES)
"""Offsets of the quantities of a sphere in a block, laid out as in
`contactsense.localization.surface.simd_layout`: centre and radius [m]; standard deviation of the surface's
offset there [m]. Result: energy of moving the line until it touches the sphere."""
SPHERES_LENGTH = 6 * LANES
"""Length of a block."""
MomentTerms = tuple[float, Vector, float, Six]
"""Result of `moment_terms`."""


@inlined_fused_kernel
def moment_terms(P: np.ndarray) -> MomentTerms:
    """What the variance of the moment about a point depends on, for the covariance P of the wrench about the
    origin, shape (6, 6): trace of the moment's covariance, twice the axial vector of its covariance with the
    force, trace of the force's covariance, and that covariance (xx, xy, xz, yy, yz, zz)."""
    axial = (2.0 * (P[1, 5] - P[2, 4]), 2.0 * (P[2, 3] - P[0, 5]), 2.0 * (P[0, 4] - P[1, 3]))
    force = (P[0, 0], P[0, 1], P[0, 2], P[1, 1], P[1, 2], P[2, 2])
    return P[3, 3] + P[4, 4] + P[5, 5], axial, P[0, 0] + P[1, 1] + P[2, 2], force


@inlined_fused_kernel
def variance_about(terms: MomentTerms, x: float, y: float, z: float) -> float:
    """Trace of the covariance of the moment about the point (x, y, z) [Nm^2], from `moment_terms`."""
    moment, axial, force, F = terms
    squared_distance = x * x + y * y + z * z
    xFx = x * (F[0] * x + 2.0 * F[1] * y + 2.0 * F[2] * z) + y * (F[3] * y + 2.0 * F[4] * z) + z * z * F[5]
    trace = moment - (axial[0] * x + axial[1] * y + axial[2] * z) + squared_distance * force - xFx
    return max(trace, 0.0)


@fused_kernel
def moment_variance(P: np.ndarray, x: float, y: float, z: float) -> float:
    """Trace of the covariance of the moment about a point [Nm^2].

    P: covariance of the wrench about the origin, shape (6, 6). x, y, z: the point [m].
    """
    variance: float = variance_about(moment_terms(P), x, y, z)
    return variance


@inlined_fused_kernel
def shift_energy(distance: float, squared_force: float, variance: float) -> float:
    """Approximate energy of moving the line of action by `distance` [m] towards a point.

    The moment about the point must change by |f| times the distance. `squared_force`: |f|^2 [N^2]. `variance`
    of the moment: of the measurement, and of the surface's offset times |f| [Nm^2].
    """
    return 0.5 * squared_force * distance * distance / variance


@fused_kernel
def spheres_to_base_frame(R: np.ndarray, o: np.ndarray, block: np.ndarray) -> None:
    """Move the spheres of a block from a link frame, of orientation R and origin o, to the base frame."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = (
        R[0, 0], R[0, 1], R[0, 2], R[1, 0], R[1, 1], R[1, 2], R[2, 0], R[2, 1], R[2, 2],
    )  # fmt: skip
    o0, o1, o2 = o[0], o[1], o[2]
    for j in range(LANES):
        x, y, z = block[CENTRE_X + j], block[CENTRE_Y + j], block[CENTRE_Z + j]
        block[CENTRE_X + j] = o0 + r00 * x + r01 * y + r02 * z
        block[CENTRE_Y + j] = o1 + r10 * x + r11 * y + r12 * z
        block[CENTRE_Z + j] = o2 + r20 * x + r21 * y + r22 * z


@fused_kernel
def shift_energies(w: np.ndarray, P: np.ndarray, squared_force: float, block: np.ndarray) -> None:
    """Energy of moving the line of action until it touches each sphere of a block; 0 if it does.

    Args:
        w, P: Wrench and its covariance, base axes, about the base origin, shapes (6,) and (6, 6).
        squared_force: Squared force, more than 0 [N^2].
        block: Spheres in the base frame; `SHIFT_ENERGY` is filled.
    """
    fx, fy, fz, mx, my, mz = w[0], w[1], w[2], w[3], w[4], w[5]
    terms = moment_terms(P)
    inverse = 1.0 / squared_force
    for j in range(LANES):
        x, y, z = block[CENTRE_X + j], block[CENTRE_Y + j], block[CENTRE_Z + j]
        # Moment about the centre; its part across the force, times |f|.
        a, b, c = mx - y * fz + z * fy, my - z * fx + x * fz, mz - x * fy + y * fx
        ax, ay, az = fy * c - fz * b, fz * a - fx * c, fx * b - fy * a
        distance = math.sqrt(ax * ax + ay * ay + az * az) * inverse - block[RADIUS + j]
        offset = block[OFFSET + j]
        variance = variance_about(terms, x, y, z) + offset * offset * squared_force
        block[SHIFT_ENERGY + j] = shift_energy(max(distance, 0.0), squared_force, variance)
