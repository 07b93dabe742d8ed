"""Candidates for a single further contact beside known ones.

With the noise and the known contacts in one normal distribution, the measurement gives the wrench of a
further contact on each link, and its covariance. That is the problem of a single contact: the search for one
contact finds the candidates, and what it integrates over the surface gives their probabilities and
covariances.
"""

from typing import NamedTuple

from contactsense.isolation.link_hypotheses import PRIOR_STD
from contactsense.kinematics.linalg.ldl import invert_spd
from contactsense.localization.candidates.candidate_buffers import Candidates
from contactsense.localization.line_accuracy import LINE_OF_ACTION_DEVIATION
from contactsense.localization.problem.searched_surface import SearchArrays
from contactsense.localization.problem.single_contact_problem import SingleContactProblem
from contactsense.localization.ranking import locate_contacts
from contactsense.multi_contact.likelihood.link_information import fill_link_information
from contactsense.multi_contact.memory.buffers import Measurement, SeedingBuffers
from contactsense.robots.jit.kernel import fused_kernel

MIN_CANDIDATE_PROBABILITY = 1e-3
"""Candidates less probable than this are dropped."""


class SingleContactSearch(NamedTuple):
    """The search for one further contact. It is without unmodelled places: they have no mode from which the
    joint search for several contacts could start."""

    problem: SingleContactProblem
    """Its hypotheses are those of `SeedingBuffers`, which `locate_further_contact` fills."""
    arrays: SearchArrays


@fused_kernel
def locate_further_contact(
    single: SingleContactSearch, measurement: Measurement, known_count: int, seeding: SeedingBuffers
) -> int:
    """Fill `single.arrays.candidates`, whose `order` lists the candidates by falling probability.

    Args:
        single: The search for one contact.
        measurement: The measurement.
        known_count: Number of known contacts.
        seeding: After `initialize_seeding`.

    Returns:
        Number of candidates.
    """
    problem, arrays = single
    scale = 1.0
    found = 0
    for _ in range(2):
        energy = _link_hypotheses(measurement, scale, seeding)
        found = locate_contacts(problem, arrays, False, seeding.link_probability)
        if found > 0 or known_count == 0:
            # Without known contacts, none means that no single contact explains the measurement.
            break
        # The known contacts have changed by more than their priors allow.
        scale = max(2.0 * energy, 1.0)
    candidates = arrays.candidates
    count = 0
    while count < found and candidates.probability[candidates.order[count]] >= MIN_CANDIDATE_PROBABILITY:
        count += 1
    return count


@fused_kernel
def _link_hypotheses(measurement: Measurement, scale: float, seeding: SeedingBuffers) -> float:
    """Fill `seeding.hypotheses`, with the covariance of the rows multiplied by `scale`; the lowest energy of
    a link."""
    rows, m = measurement
    for r in range(m):
        for s in range(r + 1):
            seeding.factor[r, s] = scale * seeding.prior_covariance[r, s]
    fill_link_information(measurement, seeding)
    energy = 0.0
    for r in range(m):
        energy += 0.5 * seeding.weighted_innovation[r] * seeding.weighted_innovation[r]
    hypotheses, lowest = seeding.hypotheses, energy
    for link in range(rows.seen.shape[0]):
        L, P, w = hypotheses.information[link], hypotheses.covariance[link], hypotheses.wrench[link]
        h = seeding.link_vector[link]
        for a in range(6):
            for b in range(6):
                L[a, b] = seeding.link_information[link, a, b]
            # Regular also where the rows do not determine all of the wrench.
            L[a, a] += 1.0 / PRIOR_STD**2
        invert_spd(L, P)
        gain = 0.0
        for a in range(6):
            w[a] = 0.0
            for b in range(6):
                w[a] += P[a, b] * h[b]
            gain += 0.5 * h[a] * w[a]
        hypotheses.energy[link] = max(energy - gain, 0.0)
        hypotheses.log_evidence[link] = -hypotheses.energy[link]
        lowest = min(lowest, hypotheses.energy[link])
    return lowest


@fused_kernel
def is_any_broad(candidates: Candidates, count: int) -> bool:
    """Whether the place of one of the first `count` candidates is so uncertain that a normal distribution
    about the most probable one does not represent it."""
    for k in range(count):
        C = candidates.covariance[candidates.order[k]]
        if C[0, 0] + C[1, 1] + C[2, 2] > LINE_OF_ACTION_DEVIATION * LINE_OF_ACTION_DEVIATION:
            return True
    return False
