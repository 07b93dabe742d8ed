"""A touch somewhere on a surface of which only the moments are known.

No place is searched there. The surface has an area, a mean and a covariance: a push f causes the moment
c x f, with c a normal variable of that mean and covariance. For a given direction of the force this is a
linear model of normal variables, so its evidence has a closed form.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from contactsense.isolation.link_hypotheses import Hypotheses
from contactsense.kinematics.linalg.ldl import ldl_solve
from contactsense.robots.jit.declaration import Floats
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.vectors import Vector
from contactsense.solvers.posterior.contact_prior import Prior, SearchBuffers

BROAD_FORCE = 2.0
"""Standard deviation of each component of a force of which nothing is known, relative to `Prior.force`."""
SMALLEST_MOMENT = 1e-3
"""Standard deviation of the moment of a push without force [Nm]."""


class SurfaceMoments(NamedTuple):
    """Log probability, mean and covariance of the place of a touch on a part of each link's surface."""

    log_weight: Annotated[Floats, "links"]
    """Log of the prior probability of a touch there; minus infinity on links without such a surface."""
    centre: Annotated[Floats, "links, 3"]
    """Mean of the surface's points, link frame [m]."""
    covariance: Annotated[Floats, "links, 3, 3"]
    """Their covariance, link axes [m^2]."""


def moments_of_points(weight: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of weighted points.

    Args:
        weight: Weights, shape (N,), with a sum above zero.
        point: Points, shape (N, 3) [m].

    Returns:
        Mean, shape (3,) [m], and covariance, shape (3, 3) [m^2].
    """
    share = weight / weight.sum()
    mean: np.ndarray = share @ point
    offset = point - mean
    return mean, (share[:, None] * offset).T @ offset


@fused_kernel
def evidence_of_touch(
    moments: SurfaceMoments,
    link: int,
    R: np.ndarray,
    o: np.ndarray,
    force: Vector,
    hypotheses: Hypotheses,
    prior: Prior,
    buffers: SearchBuffers,
) -> float:
    """Log evidence of a touch somewhere on a surface of which the moments are known, with its prior
    probability.

    Args:
        moments: The surfaces.
        link: Link of the surface.
        R: Rotation from the link's to the base frame, shape (3, 3).
        o: Origin of the link, base frame, shape (3,) [m].
        force: Force that the measurement suggests, base axes [N].
        hypotheses: One fused wrench per link, see `contactsense.isolation.link_hypotheses.isolate`.
        prior: Prior of contacts.
        buffers: Scratch.
    """
    force_std = BROAD_FORCE * prior.force
    squared_lever = (
        prior.torsion_lever * prior.torsion_lever + prior.surface_deviation * prior.surface_deviation
    )
    H, g = buffers.normal_equations, buffers.gradient
    fx, fy, fz = force
    s, C = moments.centre[link], moments.covariance[link]
    cx = o[0] + R[0, 0] * s[0] + R[0, 1] * s[1] + R[0, 2] * s[2]
    cy = o[1] + R[1, 0] * s[0] + R[1, 1] * s[1] + R[1, 2] * s[2]
    cz = o[2] + R[2, 0] * s[0] + R[2, 1] * s[1] + R[2, 2] * s[2]
    # The force in link axes, and the covariance of the moment there: [f] C [f]^T + variance I.
    ax = R[0, 0] * fx + R[1, 0] * fy + R[2, 0] * fz
    ay = R[0, 1] * fx + R[1, 1] * fy + R[2, 1] * fz
    az = R[0, 2] * fx + R[1, 2] * fy + R[2, 2] * fz
    variance = SMALLEST_MOMENT * SMALLEST_MOMENT + squared_lever * (fx * fx + fy * fy + fz * fz)
    m00 = variance + ay * (ay * C[2, 2] - az * C[1, 2]) - az * (ay * C[1, 2] - az * C[1, 1])
    m11 = variance + az * (az * C[0, 0] - ax * C[0, 2]) - ax * (az * C[0, 2] - ax * C[2, 2])
    m22 = variance + ax * (ax * C[1, 1] - ay * C[0, 1]) - ay * (ax * C[0, 1] - ay * C[0, 0])
    m01 = ay * (az * C[0, 2] - ax * C[2, 2]) - az * (az * C[0, 1] - ax * C[1, 2])
    m02 = ay * (ax * C[1, 2] - ay * C[0, 2]) - az * (ax * C[1, 1] - ay * C[0, 1])
    m12 = az * (ax * C[0, 1] - ay * C[0, 0]) - ax * (ax * C[1, 2] - ay * C[0, 2])
    i00, i01, i02 = m11 * m22 - m12 * m12, m02 * m12 - m01 * m22, m01 * m12 - m02 * m11
    i11, i12, i22 = m00 * m22 - m02 * m02, m01 * m02 - m00 * m12, m00 * m11 - m01 * m01
    determinant = m00 * i00 + m01 * i01 + m02 * i02
    energy = copy_measurement(hypotheses, link, H, g)
    # The prior's information of (f, m): force^-2 on f, and that of the moment M on m - c x f.
    for i in range(3):
        H[i, i] += force_std**-2.0
        bx, by, bz = R[i, 0] / determinant, R[i, 1] / determinant, R[i, 2] / determinant
        row = (
            bx * i00 + by * i01 + bz * i02,
            bx * i01 + by * i11 + bz * i12,
            bx * i02 + by * i12 + bz * i22,
        )
        for k in range(3):
            information = row[0] * R[k, 0] + row[1] * R[k, 1] + row[2] * R[k, 2]
            buffers.frame[i, k] = information
            H[3 + i, 3 + k] += information
    N = buffers.frame
    for k in range(3):
        # Blocks [c] N and [c]^T N [c], column by column of N.
        x, y, z = cy * N[2, k] - cz * N[1, k], cz * N[0, k] - cx * N[2, k], cx * N[1, k] - cy * N[0, k]
        H[0, 3 + k] += x
        H[1, 3 + k] += y
        H[2, 3 + k] += z
        column = (0.0, -cz, cy) if k == 0 else (cz, 0.0, -cx) if k == 1 else (-cy, cx, 0.0)
        for i in range(3):
            H[0, i] -= x * column[i]
            H[1, i] -= y * column[i]
            H[2, i] -= z * column[i]
    log_det, decrease, _, _, _ = ldl_solve(H, g)
    log_det_prior = -6.0 * math.log(force_std) - math.log(determinant)
    return float(
        moments.log_weight[link]
        - hypotheses.energy[link]
        - (energy - decrease)
        + 0.5 * (log_det_prior - log_det)
    )


@fused_kernel
def copy_measurement(hypotheses: Hypotheses, link: int, H: np.ndarray, g: np.ndarray) -> float:
    """Fill the normal equations H x = g with the fused wrench of a link; returns its energy at x = 0."""
    w, L = hypotheses.wrench[link], hypotheses.information[link]
    energy = 0.0
    for i in range(6):
        g[i] = 0.0
        for k in range(6):
            g[i] += L[i, k] * w[k]
            H[i, k] = L[i, k]
        energy += 0.5 * w[i] * g[i]
    return energy
