"""Stores a joint optimum as an explanation: its contacts, their covariances and its evidence."""

import numpy as np

from contactsense.kinematics.wrench_information import matvec
from contactsense.localization.candidates.candidate_buffers import Candidates
from contactsense.localization.candidates.mixture_reduction import mean, second_moments, write_moments
from contactsense.multi_contact.joint.contact_step import vector_of
from contactsense.multi_contact.joint.joint_covariance import covariance_of
from contactsense.multi_contact.memory.buffers import Explanations, JointState
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.vectors import dot, subtract, vector
from contactsense.solvers.posterior.contact_prior import Contact
from contactsense.solvers.posterior.friction_tails import curvature_along, with_friction_tails

from contactsense.multi_contact.memory.joint_layout import (  # isort: skip
    ENERGY, FRICTION_RATIO, FX, LOG_EVIDENCE, NX, OFFSET_STEP, PX, R00, R01, R02, R10, R11, R12, R20, R21,
    R22, S00, S01, S02, S11, S12, S22, SX, TILT, TORSION, TX, W0,
)  # fmt: skip


@fused_kernel
def store_explanation(
    joint: JointState,
    lane: int,
    count: int,
    prior_log_evidence: float,
    explanations: Explanations,
    t: int,
) -> None:
    """Write the contacts of a lane as explanation t, after `fill_covariances`; its log evidence is relative
    to `prior_log_evidence`."""
    explanations.contacts[t] = count
    explanations.energy[t] = joint.lane[ENERGY, lane]
    explanations.log_evidence[t] = joint.lane[LOG_EVIDENCE, lane] - prior_log_evidence
    explanations.score[t] = explanations.log_evidence[t]
    for k in range(6):
        explanations.wrench[t, k] = 0.0
    for i in range(count):
        block = joint.contact[i]
        explanations.primitive[t, i] = joint.primitive[i, lane]
        explanations.torsion[t, i] = block[TORSION + lane]
        for k in range(3):
            at = k * LANES + lane
            explanations.point[t, i, k] = block[PX + at]
            explanations.normal[t, i, k] = block[NX + at]
            explanations.force[t, i, k] = block[FX + at]
        for k in range(6):
            explanations.wrench[t, k] += block[W0 + k * LANES + lane]
        _place_covariance(joint, lane, i, explanations.covariance[t, i])
    for a in range(6):
        for b in range(6):
            explanations.wrench_covariance[t, a, b] = covariance_of(joint, 2 * count + a, 2 * count + b, lane)


@fused_kernel
def _place_covariance(joint: JointState, lane: int, i: int, out: np.ndarray) -> None:
    """Covariance of the place of contact i, shape (3, 3) [m^2].

    Torsion moves a place where the real surface is tilted, see
    `contactsense.localization.candidates.surface_tails`.
    """
    block = joint.contact[i]
    n, tangents = vector_of(block, NX, lane), (vector_of(block, SX, lane), vector_of(block, TX, lane))
    force = vector_of(block, FX, lane)
    along_normal = block[OFFSET_STEP + lane] * block[OFFSET_STEP + lane]
    shift = block[TILT + lane] * block[TORSION + lane] / dot(force, n)
    laplace = (
        covariance_of(joint, 2 * i, 2 * i, lane),
        covariance_of(joint, 2 * i + 1, 2 * i, lane),
        covariance_of(joint, 2 * i + 1, 2 * i + 1, lane),
    )
    contact = Contact(vector_of(block, PX, lane), n, force, block[TORSION + lane])
    variances = with_friction_tails(laplace, _curvature(block, lane), contact, block[FRICTION_RATIO + lane])
    for k in range(3):
        for a in range(3):
            out[k, a] = along_normal * n[k] * n[a]
            for b in range(2):
                out[k, a] += shift * shift * tangents[b][k] * tangents[b][a]
                for d in range(2):
                    out[k, a] += tangents[b][k] * tangents[d][a] * variances[b + d]


@fused_kernel
def _curvature(block: np.ndarray, lane: int) -> tuple[float, float, float]:
    """Curvature of the surface along both tangents [1/m]; its shape operator is in the axes of the body."""
    axes = (
        (block[R00 + lane], block[R10 + lane], block[R20 + lane]),
        (block[R01 + lane], block[R11 + lane], block[R21 + lane]),
        (block[R02 + lane], block[R12 + lane], block[R22 + lane]),
    )
    shape_operator = (
        block[S00 + lane], block[S01 + lane], block[S02 + lane],
        block[S11 + lane], block[S12 + lane], block[S22 + lane],
    )  # fmt: skip
    tangents = matvec(axes, vector_of(block, SX, lane)), matvec(axes, vector_of(block, TX, lane))
    found: tuple[float, float, float] = curvature_along(shape_operator, tangents)
    return found


@fused_kernel
def mix_with_candidate(candidates: Candidates, row: int, i: int, explanations: Explanations, t: int) -> None:
    """Mix the place of contact i of explanation t with the candidate at which its optimization started, and
    give the explanation the candidate's probability.

    Both are normal distributions that approximate the same posterior. Laplace's about the optimum has the
    known contacts as they are, but not how the surface curves away. The candidate's is integrated over the
    surface, but takes the moment that known contacts leave open as independent of their forces. The result is
    the covariance of their mixture in equal parts, about the optimum.
    """
    explanations.probability[t] = candidates.probability[row]
    C = explanations.covariance[t, i]
    offset = subtract(vector(candidates.point[row]), vector(explanations.point[t, i]))
    optimum = second_moments(C, (0.0, 0.0, 0.0))
    write_moments(mean(optimum, second_moments(candidates.covariance[row], offset), 0.5), C)
