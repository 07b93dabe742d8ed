"""The evidence of "none of these": of a wrench that no single push on a searched link causes.

It may be anything, such as a pull, a couple or several contacts: a broad normal distribution. Or it is a
touch on a link that the scene leaves out; no place is searched there
(`contactsense.localization.surface.surface_moments`).
"""

import math

import numpy as np

from contactsense.isolation.link_hypotheses import Hypotheses
from contactsense.kinematics.linalg.ldl import ldl_solve
from contactsense.kinematics.model import Motion
from contactsense.localization.log_sum import log_add
from contactsense.localization.surface.surface_moments import (
    BROAD_FORCE,
    SurfaceMoments,
    copy_measurement,
    evidence_of_touch,
)
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.solvers.posterior.contact_prior import Prior, SearchBuffers
from contactsense.solvers.posterior.mode import ENERGY_CUTOFF

NONE_OF_THESE_PROBABILITY = 0.01
"""Prior probability of a wrench that may be anything."""
NONE_OF_THESE_LEVER = 0.5
"""Standard deviation of each moment component about the base origin per force if it may be anything [m]."""


@fused_kernel
def none_of_these_evidence(
    left_out: SurfaceMoments,
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
        left_out: Links that can be touched but are not searched; their prior probability is relative to that
            of a touch on any searched link.
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
        force = (buffers.gradient[0], buffers.gradient[1], buffers.gradient[2])
        evidence = evidence_of_touch(
            left_out, k, motion.rotation[depth[k]], motion.origin[depth[k]], force, hypotheses, prior, buffers
        )
        is_touch = is_touch or evidence > anything
        total = log_add(total, evidence)
    return total, is_touch


@fused_kernel
def _evidence_of_anything(hypotheses: Hypotheses, link: int, prior: Prior, buffers: SearchBuffers) -> float:
    """Log evidence of a wrench with a broad zero-mean normal prior, at `link`; `buffers.gradient` then holds
    the most probable wrench."""
    H, g = buffers.normal_equations, buffers.gradient
    force_std = BROAD_FORCE * prior.force
    moment_std = NONE_OF_THESE_LEVER * force_std
    force_information, moment_information = 1.0 / (force_std * force_std), 1.0 / (moment_std * moment_std)
    energy = copy_measurement(hypotheses, link, H, g)
    for i in range(6):
        H[i, i] += force_information if i < 3 else moment_information
    log_det, decrease, _, _, _ = ldl_solve(H, g)
    log_det_prior = -6.0 * math.log(force_std * moment_std)
    log_odds = math.log(NONE_OF_THESE_PROBABILITY / (1.0 - NONE_OF_THESE_PROBABILITY))
    return float(log_odds - hypotheses.energy[link] - (energy - decrease) + 0.5 * (log_det_prior - log_det))
