"""The evidence of "none of these": of a wrench that no single push on a searched link causes.

It may be anything, such as a pull, a couple or several contacts: a broad normal distribution. Or it is a
touch on a link that the scene leaves out. No place is searched on such a link. Its surface is known by area,
centre and covariance only: a push f there causes the moment c x f, with c a normal variable of that centre
and covariance. For the direction of the measured force this is a linear model of normal variables, so its
evidence has a closed form.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from contactsense.isolation.link_hypotheses import Hypotheses
from contactsense.kinematics.linalg.ldl import ldl_solve
from contactsense.kinematics.model import Motion
from contactsense.robots.jit.declaration import Floats
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.solvers.posterior.contact_prior import Prior, SearchBuffers
from contactsense.solvers.posterior.mode import ENERGY_CUTOFF

NONE_OF_THESE_PROBABILITY = 0.01
"""Prior probability of a wrench that may be anything."""
NONE_OF_THESE_FORCE = 2.0
"""Standard deviation of each force component under "none of these", relative to `Prior.force`."""
NONE_OF_THESE_LEVER = 0.5
"""Standard deviation of each moment component about the base origin per force if it may be anything [m]."""
SMALLEST_MOMENT = 1e-3
"""Standard deviation of the moment of a push without force [Nm]."""


class LeftOutLinks(NamedTuple):
    """Surfaces of links that can be touched but are left out of the search."""

    log_weight: Annotated[Floats, "links"]
    """Log of the prior probability of a touch on each link relative to that of a touch on any searched link;
    minus infinity for searched links, and for links that cannot be touched."""
    centre: Annotated[Floats, "links, 3"]
    """Centre of the surface, link frame [m]."""
    covariance: Annotated[Floats, "links, 3, 3"]
    """Covariance of the surface's points, link axes [m^2]."""


@fused_kernel
def none_of_these_evidence(
    left_out: LeftOutLinks,
    depth: np.ndarray,
    motion: Motion,
    hypotheses: Hypotheses,
    link: int,
    prior: Prior,
    buffers: SearchBuffers,
) -> tuple[float, bool]:
    """Log evidence of "none of these", relative to the prior of a touch on a searched link.

    Links whose evidence is negligible beside what is found already are passed over: the likelihood of a touch
    on a link is at most exp(-energy) of that link.

    Args:
        left_out: Links that can be touched but are not searched.
        depth: Number of joints between the base and each link, shape (links,), int64.
        motion: Poses, see `contactsense.kinematics.forward_kinematics.forward_kinematics`.
        hypotheses: One fused wrench per link, see `contactsense.isolation.link_hypotheses.isolate`.
        link: Link on which a wrench that may be anything fits best.
        prior: Prior of contacts.
        buffers: Scratch.

    Returns:
        The evidence, and whether a touch on one of the links left out has more than a wrench that may be
        anything.
    """
    anything = _evidence_of_anything(hypotheses, link, prior, buffers)
    total, is_touch = anything, False
    for k in range(depth.shape[0]):
        if not left_out.log_weight[k] - hypotheses.energy[k] >= total - ENERGY_CUTOFF:
            continue
        _evidence_of_anything(hypotheses, k, prior, buffers)
        evidence = _evidence_of_touch(
            left_out, k, motion.rotation[depth[k]], motion.origin[depth[k]], hypotheses, prior, buffers
        )
        is_touch = is_touch or evidence > anything
        high, low = max(total, evidence), min(total, evidence)
        total = high if low == -math.inf else high + math.log1p(math.exp(low - high))
    return total, is_touch


@fused_kernel
def _copy_measurement(hypotheses: Hypotheses, link: int, H: np.ndarray, g: np.ndarray) -> float:
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


@fused_kernel
def _evidence_of_anything(hypotheses: Hypotheses, link: int, prior: Prior, buffers: SearchBuffers) -> float:
    """Log evidence of a wrench with a broad zero-mean normal prior, at `link`; `buffers.gradient` then holds
    the most probable wrench."""
    H, g = buffers.normal_equations, buffers.gradient
    force_std = NONE_OF_THESE_FORCE * prior.force
    moment_std = NONE_OF_THESE_LEVER * force_std
    force_information, moment_information = 1.0 / (force_std * force_std), 1.0 / (moment_std * moment_std)
    energy = _copy_measurement(hypotheses, link, H, g)
    for i in range(6):
        H[i, i] += force_information if i < 3 else moment_information
    log_det, decrease, _, _, _ = ldl_solve(H, g)
    log_det_prior = -6.0 * math.log(force_std * moment_std)
    log_odds = math.log(NONE_OF_THESE_PROBABILITY / (1.0 - NONE_OF_THESE_PROBABILITY))
    return float(log_odds - hypotheses.energy[link] - (energy - decrease) + 0.5 * (log_det_prior - log_det))


@fused_kernel
def _evidence_of_touch(
    left_out: LeftOutLinks,
    link: int,
    R: np.ndarray,
    o: np.ndarray,
    hypotheses: Hypotheses,
    prior: Prior,
    buffers: SearchBuffers,
) -> float:
    """Log evidence of a touch on a link that is left out, of orientation R and origin o, with its
    `log_weight`; `buffers.gradient` holds a force that the measurement suggests."""
    force = NONE_OF_THESE_FORCE * prior.force
    squared_lever = (
        prior.torsion_lever * prior.torsion_lever + prior.surface_deviation * prior.surface_deviation
    )
    H, g = buffers.normal_equations, buffers.gradient
    fx, fy, fz = g[0], g[1], g[2]
    s, C = left_out.centre[link], left_out.covariance[link]
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
    energy = _copy_measurement(hypotheses, link, H, g)
    # The prior's information of (f, m): force^-2 on f, and that of the moment M on m - c x f.
    for i in range(3):
        H[i, i] += force**-2.0
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
    log_det_prior = -6.0 * math.log(force) - math.log(determinant)
    return float(
        left_out.log_weight[link]
        - hypotheses.energy[link]
        - (energy - decrease)
        + 0.5 * (log_det_prior - log_det)
    )
