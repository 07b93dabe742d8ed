"""Explanations of one measurement as arrays, and how a result of the search is kept in them."""

from typing import NamedTuple

import numpy as np

from robots.compiled import fused_kernel

MOST = 8
"""Most explanations where the search is not one by primitive."""
BUMP = 0.0035
"""Length over which the real surface leaves a primitive [m]: its offset over its tilt, the standard
deviations of Gaussians that hold as much in 90 % of the cases as was measured (`contactsense bench geometry
--json`: 0.8 mm and 16 to 19 degrees)."""
STEEP = 0.33
"""The tilt of a surface whose primitives are far off, measured alike on `coarse` (36 to 44 degrees) [rad]."""


class Candidates(NamedTuple):
    """Explanations of one measurement, a row each; `order` lists the rows that count. Base axes.

    Where the measurement tells where to look, row p belongs to primitive p. Where it does not, rows are
    filled as explanations are found, and a primitive may have several.
    """

    order: np.ndarray
    """Rows by falling probability, shape (R,), int64."""
    primitive: np.ndarray
    """Primitive that is touched, shape (R,), int64."""
    score: np.ndarray
    """Log evidence, shape (R,)."""
    probability: np.ndarray
    """Probability of those that `order` lists, shape (R,)."""
    point: np.ndarray
    """Contact centroid [m], shape (R, 3)."""
    normal: np.ndarray
    """Outward unit normal, shape (R, 3)."""
    force: np.ndarray
    """Force on the robot [N], shape (R, 3)."""
    torsion: np.ndarray
    """Moment on the robot about the outward normal [Nm], shape (R,)."""
    covariance: np.ndarray
    """Covariance of `point` [m^2], shape (R, 3, 3)."""
    wrench: np.ndarray
    """Fused wrench of the link's hypothesis in each primitive's body frame, shape (P, 6) [N, Nm]."""
    information: np.ndarray
    """Its information matrix, shape (P, 6, 6)."""
    rotation: np.ndarray
    """Axes of every primitive's body frame in the base frame, shape (P, 3, 3)."""
    origin: np.ndarray
    """Origin of every primitive's body frame in the base frame [m], shape (P, 3)."""


def empty_candidates(primitives: int) -> Candidates:
    """Arrays for that many primitives."""
    rows = max(primitives, MOST)
    return Candidates(
        order=np.zeros(rows, dtype=np.int64),
        primitive=np.zeros(rows, dtype=np.int64),
        score=np.zeros(rows),
        probability=np.zeros(rows),
        point=np.zeros((rows, 3)),
        normal=np.zeros((rows, 3)),
        force=np.zeros((rows, 3)),
        torsion=np.zeros(rows),
        covariance=np.zeros((rows, 3, 3)),
        wrench=np.zeros((primitives, 6)),
        information=np.zeros((primitives, 6, 6)),
        rotation=np.zeros((primitives, 3, 3)),
        origin=np.zeros((primitives, 3)),
    )


@fused_kernel
def turn(R, x, y, z, out):  # type: ignore[no-untyped-def]
    """out = R (x, y, z)."""
    for i in range(3):
        out[i] = R[i, 0] * x + R[i, 1] * y + R[i, 2] * z


@fused_kernel
def store(found, row, p, result, work, offset):  # type: ignore[no-untyped-def]
    """Keep one result of `refine` on primitive p, in base axes, in a row of `found`.

    Its covariance is the search's, and what comes of the real surface's tilt: the torsion xi acts about
    another normal, by d, so that the moment is off by xi d, and the place by xi d / F (theory, section 4).
    """
    _, _, cx, cy, cz, nx, ny, nz, fx, fy, fz, xi, v11, v12, v22 = result
    found.primitive[row] = p
    R, o, T = found.rotation[p], found.origin[p], work.frame
    turn(R, cx, cy, cz, found.point[row])
    turn(R, nx, ny, nz, found.normal[row])
    turn(R, fx, fy, fz, found.force[row])
    found.torsion[row] = xi
    t1, t2 = work.gradient[:3], work.gradient[3:]
    turn(R, T[0, 1], T[1, 1], T[2, 1], t1)
    turn(R, T[0, 2], T[1, 2], T[2, 2], t2)
    n = found.normal[row]
    turned = min(offset / BUMP, STEEP) * xi / (fx * nx + fy * ny + fz * nz)
    v11 += turned * turned
    v22 += turned * turned
    for i in range(3):
        found.point[row, i] += o[i]
        for k in range(3):
            found.covariance[row, i, k] = (
                t1[i] * (v11 * t1[k] + v12 * t2[k])
                + t2[i] * (v12 * t1[k] + v22 * t2[k])
                + n[i] * n[k] * offset * offset
            )
