"""Most probable contact on one primitive, or on several at once, by Gauss-Newton on the surface; see
`contactsense.solvers.posterior.equations`.

Each primitive has a lane of the processor's vector registers, so that a step on eight of them takes as long
as on one.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.kinematics.logarithm import logarithm
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.surface.convex_primitives import REVOLVED, curvature
from contactsense.robots.vectors import Vector, norm
from contactsense.solvers.posterior.contact_prior import Contact, Prior, log_prior
from contactsense.solvers.posterior.friction_tails import curvature_along, with_friction_tails
from contactsense.solvers.posterior.simd import (
    contact_of,
    energies_of_trials,
    gauss_newton_steps,
    load_primitive,
    load_prior,
    load_wrench,
    project_others,
    project_trials,
    shape_operators,
    store_contact,
    trial_of,
)

from contactsense.solvers.posterior.block import (  # isort: skip
    DECREASE, DET, ENERGY, KXX, KXY, KXZ, KYY, KYZ, KZZ, LEAST_ENERGY, NORMAL_FORCE, OTHER_ENERGY,
    REALIZED, SCALE, SEARCH, STEPS, T1X, T1Y, T1Z, T2X, T2Y, T2Z, TRIALS, TRIAL_ENERGY, TRIAL_LOG_FORCE,
    V11, V12, V22, VARIANCE_RATIO,
)  # fmt: skip

MAX_ITERATIONS = 12
"""Maximum number of Gauss-Newton steps."""
LINE_SEARCH_STEPS = 4
"""Maximum number of step lengths tried in one line search."""
ENERGY_CUTOFF = 8.0
"""Candidates whose energy or log evidence is worse than the best by this much are dropped (odds of 3e-4)."""
ENERGY_TOLERANCE = 5e-3
"""Converged if a step lowers the energy by less than this: a tenth of a standard deviation."""
RELATIVE_TOLERANCE = 0.05
"""Additional tolerance per unit of energy by which a candidate is worse than the best so far."""
REJECTION_FACTOR = 3.0
"""A candidate above the limit is rejected unless this many times the predicted decrease brings it below."""
REALIZED_STEPS = 2
"""After this many steps, only that share of the predicted decrease is expected that the last step has
realized."""
IDLE, SEARCHING, CONVERGED, HOPELESS = 0.0, 1.0, -1.0, -2.0
"""Values of `SEARCH`: no search; it goes on; it has ended at a mode; it has ended above the limit."""


class Mode(NamedTuple):
    """The most probable contact on one primitive, body frame."""

    energy: float
    """Negative log of the posterior density."""
    log_evidence: float
    """Log evidence of a contact near this mode (Laplace approximation, up to the constant of the noise);
    -infinity if the energy stays above the limit or the Gauss-Newton matrix is not positive definite."""
    contact: Contact
    variances: tuple[float, float, float]
    """Covariance of the point along the two tangents (v11, v12, v22) [m^2]."""
    tangents: tuple[Vector, Vector]
    """The two tangents: unit vectors."""


@fused_kernel
def find_posterior_mode(
    kind: np.ndarray,
    size: np.ndarray,
    primitive: np.ndarray,
    w: np.ndarray,
    L: np.ndarray,
    prior: Prior,
    start: Contact,
    block: np.ndarray,
    energy_tolerance: float = ENERGY_TOLERANCE,
) -> Mode:
    """Most probable contact on one primitive, from an initial guess on its surface. Body frame.

    Args:
        kind, size: Primitives, as in `contactsense.robots.surface.convex_primitives.Surfaces`.
        primitive: The number of the one, shape (1,), int64.
        w, L: Fused wrench and its information matrix, body frame, shapes (6,) and (6, 6).
        prior: Prior of contacts.
        start: Initial guess: a `Contact` on the surface with a force that pushes.
        block: Scratch, see `contactsense.solvers.posterior.block`.
        energy_tolerance: Converged if a step lowers the energy by less than this.

    Returns:
        The `Mode`.
    """
    p = primitive[0]
    load_primitive(0, kind[p], size[p], 0.0, block)
    load_wrench(0, w, L, block)
    load_prior(0, prior, block)
    begin_search(0, start, 0.0, -math.inf, prior, block)
    find_posterior_modes(kind, size, primitive, prior, math.inf, energy_tolerance, block)
    mode: Mode = mode_of(0, prior, block)
    return mode


@fused_kernel
def begin_search(
    j: int, start: Contact, other_energy: float, least_energy: float, prior: Prior, block: np.ndarray
) -> None:
    """Begin the search in lane j, with its primitive, wrench and prior loaded.

    Args:
        j: The lane.
        start: Initial guess: a contact on the surface with a force that pushes, body frame.
        other_energy: What adds to the energy when lanes are compared.
        least_energy: A lower bound of the energy, the other included.
        prior: Prior of contacts.
        block: The block.
    """
    n, f = start.normal, start.force
    normal_force = -(f[0] * n[0] + f[1] * n[1] + f[2] * n[2])
    store_contact(j, start, logarithm(normal_force / prior.force), block)
    block[OTHER_ENERGY + j], block[LEAST_ENERGY + j] = other_energy, least_energy
    _restart(j, block)


@fused_kernel
def _restart(j: int, block: np.ndarray) -> None:
    """Let the search in lane j begin at its contact."""
    block[SEARCH + j], block[STEPS + j], block[TRIALS + j], block[SCALE + j] = SEARCHING, 0.0, 0.0, 1.0


@fused_kernel
def find_posterior_modes(
    kind: np.ndarray,
    size: np.ndarray,
    primitives: np.ndarray,
    prior: Prior,
    lowest_energy: float,
    energy_tolerance: float,
    block: np.ndarray,
) -> float:
    """Go on with the searches of a block until each has converged or is hopeless beside the others.

    A search is hopeless if its energy, with `OTHER_ENERGY`, stays more than `ENERGY_CUTOFF` above the
    lowest one.

    Args:
        kind, size: Primitives, as for `find_posterior_mode`.
        primitives: The number of that of each lane in use, shape (lanes,), int64.
        prior: Prior of contacts.
        lowest_energy: An energy that has been reached elsewhere.
        energy_tolerance: Converged if a step lowers the energy by less than this.
        block: The block.

    Returns:
        The lowest energy.
    """
    lanes, searching = primitives.shape[0], True
    while searching:
        shape_operators(lanes, block)
        _other_shape_operators(kind, size, primitives, block)
        gauss_newton_steps(prior.torsion_lever, lanes, block)
        for j in range(lanes):
            if block[SEARCH + j] == SEARCHING:
                lowest_energy = min(lowest_energy, block[ENERGY + j] + block[OTHER_ENERGY + j])
        searching = False
        for j in range(lanes):
            if block[SEARCH + j] == SEARCHING:
                block[SEARCH + j] = _before_a_step(j, lowest_energy, energy_tolerance, block)
                searching = searching or block[SEARCH + j] == SEARCHING
        if searching:
            project_trials(lanes, block)
            project_others(kind, size, primitives, block)
            energies_of_trials(prior.torsion_lever, prior.force, lanes, block)
            searching = False
            for j in range(lanes):
                if block[SEARCH + j] == SEARCHING:
                    block[SEARCH + j] = _after_a_step(j, lowest_energy, energy_tolerance, block)
                    searching = searching or block[SEARCH + j] == SEARCHING
    return lowest_energy


@fused_kernel
def resume_searches(lanes: int, lowest_energy: float, block: np.ndarray) -> bool:
    """Go on with those searches of the first lanes that are not hopeless beside that lowest energy, but were
    beside a lower one; returns whether there are any."""
    found = False
    for j in range(lanes):
        if block[SEARCH + j] == HOPELESS and block[LEAST_ENERGY + j] <= lowest_energy + ENERGY_CUTOFF:
            _restart(j, block)
            found = True
    return found


@fused_kernel
def _end(j: int, least_energy: float, lowest_energy: float, block: np.ndarray) -> float:
    """State of a search that ends at a contact of that energy, `OTHER_ENERGY` included; or that is given up,
    since it cannot go below."""
    block[LEAST_ENERGY + j] = least_energy
    return CONVERGED if least_energy <= lowest_energy + ENERGY_CUTOFF else HOPELESS


@fused_kernel
def _before_a_step(j: int, lowest_energy: float, energy_tolerance: float, block: np.ndarray) -> float:
    """State of the search in lane j, with the Gauss-Newton step from its contact."""
    if block[TRIALS + j] > 0.0:
        return SEARCHING
    energy, decrease = block[ENERGY + j] + block[OTHER_ENERGY + j], block[DECREASE + j]
    if not block[DET + j] > 0.0:
        return _end(j, math.inf, lowest_energy, block)
    realized = block[REALIZED + j] if block[STEPS + j] >= REALIZED_STEPS else 1.0
    least_energy = max(energy - REJECTION_FACTOR * realized * decrease, block[LEAST_ENERGY + j])
    if least_energy > lowest_energy + ENERGY_CUTOFF:
        return _end(j, least_energy, lowest_energy, block)
    tolerance = _tolerance(energy - decrease - lowest_energy, energy_tolerance)
    if decrease < tolerance or block[STEPS + j] >= MAX_ITERATIONS:
        return _end(j, energy, lowest_energy, block)
    return SEARCHING


@fused_kernel
def _tolerance(excess: float, energy_tolerance: float) -> float:
    """The worse a candidate is, the less its accuracy matters."""
    return energy_tolerance + RELATIVE_TOLERANCE * max(excess, 0.0)


@fused_kernel
def _after_a_step(j: int, lowest_energy: float, energy_tolerance: float, block: np.ndarray) -> float:
    """State of the search in lane j, with the energy of the contact that is tried: the contact is taken, or
    the step becomes shorter."""
    energy, decrease, scale = block[ENERGY + j], block[DECREASE + j], block[SCALE + j]
    total = energy + block[OTHER_ENERGY + j]
    trial_energy = block[TRIAL_ENERGY + j] if block[NORMAL_FORCE + j] > 0.0 else math.inf
    if trial_energy < energy:
        store_contact(j, trial_of(j, block), block[TRIAL_LOG_FORCE + j], block)
        block[ENERGY + j], block[SCALE + j], block[TRIALS + j] = trial_energy, 1.0, 0.0
        block[STEPS + j] += 1.0
        tolerance = _tolerance(total - decrease - lowest_energy, energy_tolerance)
        actual = energy - trial_energy
        block[REALIZED + j] = min(actual / decrease, 1.0)
        # If the quadratic model holds, the next step would be negligible.
        if actual < tolerance or (scale == 1.0 and abs(actual - decrease) < tolerance):
            return _end(j, total - actual, lowest_energy, block)
        return SEARCHING
    block[TRIALS + j] += 1.0
    if total - decrease > lowest_energy + ENERGY_CUTOFF:
        return _end(j, total - decrease, lowest_energy, block)
    if block[TRIALS + j] >= LINE_SEARCH_STEPS:
        return _end(j, total, lowest_energy, block)
    # Minimum of the parabola through both energies with the slope at the start.
    shorter = decrease * scale / (trial_energy - energy + 2.0 * decrease * scale)
    block[SCALE + j] = scale * min(max(shorter, 0.1), 0.5)
    return SEARCHING


@fused_kernel
def _other_shape_operators(
    kind: np.ndarray, size: np.ndarray, primitives: np.ndarray, block: np.ndarray
) -> None:
    """`shape_operators` of primitives that are no bodies of revolution."""
    for j in range(primitives.shape[0]):
        p = primitives[j]
        if kind[p] != REVOLVED and block[SEARCH + j] == SEARCHING:
            (cx, cy, cz), (nx, ny, nz), _, _ = contact_of(j, block)
            K = curvature(kind[p], size[p], cx, cy, cz, nx, ny, nz)
            block[KXX + j], block[KXY + j], block[KXZ + j] = K[0], K[1], K[2]
            block[KYY + j], block[KYZ + j], block[KZZ + j] = K[3], K[4], K[5]


@fused_kernel
def mode_of(j: int, prior: Prior, block: np.ndarray) -> Mode:
    """The mode at which the search in lane j has ended.

    `prior`: that about the place where the search began.
    """
    contact, (v11, v12, v22) = contact_of(j, block), (block[V11 + j], block[V12 + j], block[V22 + j])
    tangents = (
        (block[T1X + j], block[T1Y + j], block[T1Z + j]),
        (block[T2X + j], block[T2Y + j], block[T2Z + j]),
    )
    if block[SEARCH + j] != CONVERGED or not block[DET + j] > 0.0:
        return Mode(math.inf, -math.inf, contact, (0.0, 0.0, 0.0), tangents)
    log_ratio = logarithm(block[DET + j]) + logarithm(block[VARIANCE_RATIO + j])
    log_evidence = log_prior(prior, norm(contact.force)) - block[ENERGY + j] - 0.5 * log_ratio
    shape_operator = (
        block[KXX + j], block[KXY + j], block[KXZ + j], block[KYY + j], block[KYZ + j], block[KZZ + j],
    )  # fmt: skip
    curvature_there = curvature_along(shape_operator, tangents)
    variances = with_friction_tails((v11, v12, v22), curvature_there, contact, prior.friction_ratio)
    return Mode(block[ENERGY + j], log_evidence, contact, variances, tangents)
