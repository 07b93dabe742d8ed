"""Lower bound of a cell's energy: excludes the cells that no contact force can explain, and tells which of
the others to try first."""

import math

import numpy as np

from contactsense.kinematics.logarithm import logarithm
from contactsense.localization.surface.simd_layout import BOUND, NX, NY, NZ, SPREAD, TILT, X, Y, Z
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.solvers.posterior.contact_prior import STUDENT_DOF

FORCE_SIGMAS = 3.0
"""The force may exceed the measured one by this many standard deviations."""
PULL_SHARE = 0.5
"""Cells are excluded as pulled if the outward part of the force exceeds this share of its magnitude."""
MIN_PUSH_SHARE = 1e-6
"""Lower bound of the largest possible normal force, relative to the measured force."""


@fused_kernel
def exclude_cells(
    w: np.ndarray,
    P: np.ndarray,
    R: np.ndarray,
    o: np.ndarray,
    squared_force: float,
    force_variance: float,
    torsion_lever: float,
    limit: float,
    block: np.ndarray,
    friction_ratio: float = math.inf,
) -> None:
    """Exclude cells that cannot have caused the measured wrench.

    The bound of a cell's energy has two terms. The moment about its centre is more than noise, torsion and
    the cell's width explain (half the chi-square of the moment); and the force within its uncertainty leans
    from the normal by more than friction explains. A cell is excluded if the bound is above the limit, or if
    the force points out of the surface.

    Args:
        w, P: Fused wrench and its covariance, base axes, about the base origin, shapes (6,) and (6, 6).
        R, o: Rotation and origin [m] of the cells' link in the base frame, shapes (3, 3) and (3,).
        squared_force, force_variance: Squared force and the trace of its covariance [N^2].
        torsion_lever: Standard deviation of torsion over normal force [m].
        limit: Energy above which a cell is excluded.
        block: Block with the cells' centres, normals, spreads and tilts; `BOUND` is filled. Loops over two
            arrays would not be vectorized: the compiler cannot know that they do not overlap.
        friction_ratio: Standard deviation of tangential over normal force along each tangent, on a surface
            that is not tilted.
    """
    # Upper bound of the squared force; times a squared lever it bounds the variance of the moment.
    force, margin = math.sqrt(squared_force), FORCE_SIGMAS * math.sqrt(force_variance)
    max_squared_force = (force + margin) ** 2
    max_outward = PULL_SHARE * force
    min_push = MIN_PUSH_SHARE * force
    squared_friction_ratio = friction_ratio * friction_ratio
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = (
        R[0, 0], R[0, 1], R[0, 2], R[1, 0], R[1, 1], R[1, 2], R[2, 0], R[2, 1], R[2, 2],
    )  # fmt: skip
    o0, o1, o2 = o[0], o[1], o[2]
    w0, w1, w2, w3, w4, w5 = w[0], w[1], w[2], w[3], w[4], w[5]
    p00, p01, p02, p11, p12, p22 = P[0, 0], P[0, 1], P[0, 2], P[1, 1], P[1, 2], P[2, 2]
    p30, p31, p32 = P[3, 0], P[3, 1], P[3, 2]
    p40, p41, p42 = P[4, 0], P[4, 1], P[4, 2]
    p50, p51, p52 = P[5, 0], P[5, 1], P[5, 2]
    p33, p34, p35, p44, p45, p55 = P[3, 3], P[3, 4], P[3, 5], P[4, 4], P[4, 5], P[5, 5]
    for j in range(LANES):
        cx, cy, cz = block[X + j], block[Y + j], block[Z + j]
        nx, ny, nz = block[NX + j], block[NY + j], block[NZ + j]
        x = o0 + r00 * cx + r01 * cy + r02 * cz
        y = o1 + r10 * cx + r11 * cy + r12 * cz
        z = o2 + r20 * cx + r21 * cy + r22 * cz
        moment_variance = max_squared_force * (
            block[SPREAD + j] * block[SPREAD + j] + torsion_lever * torsion_lever
        )
        outward_force = (
            w0 * (r00 * nx + r01 * ny + r02 * nz)
            + w1 * (r10 * nx + r11 * ny + r12 * nz)
            + w2 * (r20 * nx + r21 * ny + r22 * nz)
        )
        a, b, c = w3 - y * w2 + z * w1, w4 - z * w0 + x * w2, w5 - x * w1 + y * w0
        # Covariance of the moment about the centre: P_mm - X G^T - G X^T, G = P_mf - 1/2 X P_ff, X = [c]x.
        hx, hy, hz = 0.5 * x, 0.5 * y, 0.5 * z
        g00, g01, g02 = p30 - hy * p02 + hz * p01, p31 - hy * p12 + hz * p11, p32 - hy * p22 + hz * p12
        g10, g11, g12 = p40 - hz * p00 + hx * p02, p41 - hz * p01 + hx * p12, p42 - hz * p02 + hx * p22
        g20, g21, g22 = p50 - hx * p01 + hy * p00, p51 - hx * p11 + hy * p01, p52 - hx * p12 + hy * p02
        s00 = p33 + moment_variance - 2.0 * (y * g02 - z * g01)
        s11 = p44 + moment_variance - 2.0 * (z * g10 - x * g12)
        s22 = p55 + moment_variance - 2.0 * (x * g21 - y * g20)
        s01 = p34 - (y * g12 - z * g11) - (z * g00 - x * g02)
        s02 = p35 - (y * g22 - z * g21) - (x * g01 - y * g00)
        s12 = p45 - (z * g20 - x * g22) - (x * g11 - y * g10)
        c00, c01, c02 = s11 * s22 - s12 * s12, s02 * s12 - s01 * s22, s01 * s12 - s02 * s11
        c11, c12, c22 = s00 * s22 - s02 * s02, s01 * s02 - s00 * s12, s00 * s11 - s01 * s01
        det = s00 * c00 + s01 * c01 + s02 * c02
        mahalanobis = (
            a * a * c00 + b * b * c11 + c * c * c22 + 2.0 * (a * b * c01 + a * c * c02 + b * c * c12)
        )
        push = max(margin - outward_force, min_push)
        tangential = max(math.sqrt(max(squared_force - outward_force * outward_force, 0.0)) - margin, 0.0)
        ratio_variance = squared_friction_ratio + block[TILT + j] * block[TILT + j]
        squared_ratio = tangential * tangential / (push * push * ratio_variance)
        friction = 0.5 * (STUDENT_DOF + 2.0) * logarithm(1.0 + squared_ratio / STUDENT_DOF)
        energy = 0.5 * mahalanobis / det + friction
        block[BOUND + j] = math.inf if (energy > limit) | (outward_force > max_outward) else energy
