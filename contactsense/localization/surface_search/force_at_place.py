"""The most probable force and torsion of a contact whose place is known, or nearly so."""

import math

import numpy as np

from contactsense.localization.surface_search.laplace_evidence import find_modes
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.vectors import Vector, dot, vector
from contactsense.solvers.posterior.contact_prior import Prior

from contactsense.localization.surface.simd_layout import (  # isort: skip
    CHI, FX, FY, FZ, NX, NY, NZ, SPREAD, TILT, X, Y, Z,
)  # fmt: skip

FIXED_SPREAD = 1e-4
"""Standard deviation of a place that is fixed [m]."""


@fused_kernel
def force_at_place(
    w: np.ndarray,
    L: np.ndarray,
    prior: Prior,
    force_deviation: float,
    point: Vector,
    normal: Vector,
    spread: float,
    block: np.ndarray,
) -> tuple[Vector, float]:
    """The posterior mode of force and torsion, given the place. The force always pushes.

    Args:
        w, L: Wrench about the frame's origin and its information matrix, shapes (6,) and (6, 6).
        prior: Prior of a contact at the place.
        force_deviation: Root of the trace of the force's covariance [N]; infinite if it is not measured.
        point: The place [m], in the same frame.
        normal: Outward unit normal there.
        spread: Standard deviation of the place along the surface [m], at least `FIXED_SPREAD`.
        block: Scratch, see `contactsense.localization.surface.simd_layout`.

    Returns:
        Force on the robot [N], and its moment about the normal [Nm].
    """
    block[X], block[Y], block[Z] = point
    block[NX], block[NY], block[NZ] = normal
    block[SPREAD], block[TILT] = spread, 0.0
    find_modes(1, w, L, prior, force_deviation, math.inf, block)
    force = (block[FX], block[FY], block[FZ])
    return force, -block[CHI] * dot(force, normal)


@fused_kernel
def forces_at_places(
    wrench: np.ndarray,
    information: np.ndarray,
    prior: Prior,
    places: tuple[np.ndarray, np.ndarray, np.ndarray],
    block: np.ndarray,
    force: np.ndarray,
    torsion: np.ndarray,
) -> None:
    """`force_at_place` for K measurements that do not determine a force by themselves.

    Args:
        wrench, information: Shapes (K, 6) and (K, 6, 6).
        prior: Prior of contacts.
        places: Points [m], outward normals and standard deviations [m], shapes (K, 3), (K, 3) and (K,).
        block: Scratch.
        force, torsion: Filled, shapes (K, 3) and (K,).
    """
    for k in range(wrench.shape[0]):
        found, torsion[k] = force_at_place(
            wrench[k],
            information[k],
            prior,
            math.inf,
            vector(places[0][k]),
            vector(places[1][k]),
            places[2][k],
            block,
        )
        force[k, 0], force[k, 1], force[k, 2] = found
