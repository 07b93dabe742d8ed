"""Known contacts as one normal distribution of their places, forces, torsions and offsets of the surface.

Places are as the earlier estimate states them. What it knows of the forces is not independent of the places:
if a place is wrong, so is its force, and the sum of all wrenches is known best of all. Given the places, the
forces are those which the earlier sample measured: the covariance given the places, and how the mean depends
on them, follow from the Gauss-Newton matrix of the known contacts alone, measured by the sensors of the
present sample. In blocks of the other unknowns c and the places v,

    H = [H_cc, H_cv; H_vc, H_vv],    c | v ~ N(c0 - H_cc^-1 H_cv (v - v0), H_cc^-1 + D),

where D is the covariance of what has changed since. In a stream D exceeds the noise: there the forces are
taken for exact before they change.

The rows U with U^T U = inverse covariance are further rows of the measurement:
E += 1/2 |U (z - z0)|^2, with z = (point, force, torsion, offset) of each known contact.
"""

import math

import numpy as np

from contactsense.kinematics.linalg.cholesky import cholesky, cholesky_solve, substitute_lower
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.multi_contact.joint.contact_step import vector_of
from contactsense.multi_contact.joint.initial_contacts import initialize_known_contact, weigh_priors
from contactsense.multi_contact.joint.joint_energy import linearize
from contactsense.multi_contact.joint.joint_optimization import take_rows
from contactsense.multi_contact.joint.joint_problem import JointProblem
from contactsense.multi_contact.joint.known_rows import Known, KnownRows, unknown_of_factor
from contactsense.multi_contact.memory.buffers import (
    KNOWN_NUMBERS,
    OTHERS,
    PLACES,
    UNKNOWNS,
    JointState,
    KnownContacts,
    KnownPriorScratch,
    Measurement,
)
from contactsense.multi_contact.memory.joint_layout import (
    ACTIVE,
    FORCE_PRIOR,
    FRICTION_RATIO,
    FX,
    MOMENT_PRIOR,
    NX,
    OFFSET_STEP,
    PX,
    SX,
    TORSION,
    TX,
)
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.vectors import Vector, dot
from contactsense.solvers.posterior.contact_prior import Prior

MIN_POINT_DEVIATION = 1e-4
"""Lower bound of the standard deviation of a known point [m]."""


@fused_kernel
def fill_known_prior(
    surface: PlacedSurface,
    prior: Prior,
    measurement: Measurement,
    known_contacts: KnownContacts,
    known: Known,
    joint: JointState,
    scratch: KnownPriorScratch,
) -> KnownRows:
    """Fill `joint.known_rows` and `joint.known_mean`; and lane 0 with the known contacts, whose `jacobian` is
    the derivative of the measurement there.

    Args:
        surface, prior: Where contacts may be, and their prior.
        measurement: The measurement.
        known_contacts, known: Known contacts; how many, and what has changed since.
        joint: Filled.
        scratch: Filled: `factor` is U in the unknowns of the joint optimization, first the steps along the
            tangents of all contacts, then their other unknowns; lower triangular.

    Returns:
        Numbers of known contacts and of their rows.
    """
    for i in range(known.contacts):
        initialize_known_contact(surface, prior, known_contacts, joint, known, prior.force, 0, i)
        _fill_mean(known_contacts, joint, i)
    if known.drift < math.inf:
        for i in range(known.contacts):
            # As when the earlier sample was measured.
            joint.contact[i, FORCE_PRIOR], joint.contact[i, MOMENT_PRIOR] = 1.0, 1.0
        for j in range(LANES):
            joint.lane[ACTIVE, j] = 1.0 if j == 0 else 0.0
        problem = JointProblem(surface.surfaces, prior, measurement, KnownRows(0, 0), known.contacts)
        take_rows(problem, joint)
        linearize(problem, joint)
    size = fill_rows(prior, known_contacts.covariance, known, joint, scratch, (0, LANES))
    if known.drift < math.inf:
        for i in range(known.contacts):
            weigh_priors(known, 0, joint.contact[i])
    return KnownRows(known.contacts, size)


@fused_kernel
def fill_rows(
    prior: Prior,
    place_covariance: np.ndarray,
    known: Known,
    joint: JointState,
    scratch: KnownPriorScratch,
    lanes: tuple[int, int],
) -> int:
    """Fill the rows of what is known of the contacts, which are in one lane.

    Args:
        prior, known: As for `fill_known_prior`.
        place_covariance: Covariance of each place, shape (MAX_CONTACTS, 3, 3) [m^2]; its tangential part is
            used.
        joint: With the contacts; if forces are held also with the Gauss-Newton matrix of the earlier sample.
            `known_rows` is filled.
        scratch: Filled.
        lanes: The lane of the contacts, which is also the first one to be filled, and the one after the last
            to be filled.

    Returns:
        Number of rows.
    """
    U, places, lane = scratch.factor, PLACES * known.contacts, lanes[0]
    size = places if known.drift == math.inf else UNKNOWNS * known.contacts
    for a in range(size):
        for b in range(size):
            U[a, b] = 0.0
    for i in range(known.contacts):
        _fill_place_factor(place_covariance[i], joint.contact[i], lane, PLACES * i, U)
    if known.drift < math.inf:
        _fill_conditional(known, joint, lane, scratch)
        for i in range(known.contacts):
            _add_change(prior, known.drift, joint.contact[i], lane, OTHERS * i, scratch)
        _fill_conditional_factor(known.contacts, scratch)
    for i in range(known.contacts):
        _expand(prior, joint.contact[i], U, (size, known.contacts, i), joint.known_rows[i], lanes)
    return size


@fused_kernel
def _fill_mean(known_contacts: KnownContacts, joint: JointState, i: int) -> None:
    """Mean of known contact i, which is in lane 0."""
    mean, place = joint.known_mean[i], vector_of(joint.contact[i], PX, 0)
    for j in range(LANES):
        for k in range(3):
            mean[k * LANES + j], mean[(3 + k) * LANES + j] = place[k], known_contacts.force[i, k]
        mean[6 * LANES + j], mean[7 * LANES + j] = joint.contact[i, TORSION], 0.0


@fused_kernel
def _fill_place_factor(C: np.ndarray, block: np.ndarray, lane: int, at: int, U: np.ndarray) -> None:
    """Factor of the information on a place: of the inverse of its covariance C in the tangent plane."""
    s, t = vector_of(block, SX, lane), vector_of(block, TX, lane)
    aa, ab, bb = MIN_POINT_DEVIATION * MIN_POINT_DEVIATION, 0.0, MIN_POINT_DEVIATION * MIN_POINT_DEVIATION
    for i in range(3):
        for k in range(3):
            aa += s[i] * C[i, k] * s[k]
            ab += s[i] * C[i, k] * t[k]
            bb += t[i] * C[i, k] * t[k]
    U[at, at] = 1.0 / math.sqrt(aa)
    U[at + 1, at + 1] = 1.0 / math.sqrt(bb - ab * ab / aa)
    U[at + 1, at] = -ab / aa * U[at + 1, at + 1]


@fused_kernel
def _fill_conditional(known: Known, joint: JointState, lane: int, scratch: KnownPriorScratch) -> None:
    """Covariance of the other unknowns given the places, in units of their priors, and the derivative of
    their mean by the places."""
    L, G, C = scratch.information, scratch.gain, scratch.covariance
    size, places = OTHERS * known.contacts, PLACES * known.contacts
    for a in range(size):
        for b in range(size):
            C[a, b] = 0.0
        for b in range(places):
            G[a, b] = 0.0
        if not known.measured:
            # Torsion and offset have their priors.
            C[a, a] = 1.0 if a % OTHERS > 2 else 0.0
    if not known.measured:
        return
    for a in range(size):
        x = unknown_of_factor(places + a, known.contacts)
        for b in range(a + 1):
            L[a, b] = joint.matrix[x, unknown_of_factor(places + b, known.contacts) * LANES + lane]
        for b in range(places):
            v = unknown_of_factor(b, known.contacts)
            G[a, b] = -joint.matrix[max(x, v), min(x, v) * LANES + lane]
        C[a, a] = 1.0
    cholesky(L, size)
    cholesky_solve(L, size, G, places)
    cholesky_solve(L, size, C, size)


@fused_kernel
def _normal_force(block: np.ndarray, lane: int) -> float:
    """Of the contact in a lane [N]."""
    return -dot(vector_of(block, NX, lane), vector_of(block, FX, lane))


@fused_kernel
def _by_force(prior: Prior, block: np.ndarray, lane: int) -> tuple[Vector, Vector, Vector, Vector]:
    """Derivatives of logarithm of the normal force, two friction ratios and torsion ratio of the contact in
    a lane by its force, in units of their priors."""
    n, f = vector_of(block, NX, lane), vector_of(block, FX, lane)
    s, t = vector_of(block, SX, lane), vector_of(block, TX, lane)
    F = _normal_force(block, lane)
    scale = 1.0 / (block[FRICTION_RATIO + lane] * F)
    p, q, r = dot(s, f) / F, dot(t, f) / F, block[TORSION + lane] / (prior.torsion_lever * F * F)
    return (
        (-n[0] / F, -n[1] / F, -n[2] / F),
        (scale * (s[0] + p * n[0]), scale * (s[1] + p * n[1]), scale * (s[2] + p * n[2])),
        (scale * (t[0] + q * n[0]), scale * (t[1] + q * n[1]), scale * (t[2] + q * n[2])),
        (r * n[0], r * n[1], r * n[2]),
    )


@fused_kernel
def _add_change(
    prior: Prior, drift: float, block: np.ndarray, lane: int, at: int, scratch: KnownPriorScratch
) -> None:
    """Add the covariance of what has changed of the contact in a lane: of its force, and of its torsion in
    proportion."""
    by_force, C = _by_force(prior, block, lane), scratch.covariance
    for a in range(4):
        for b in range(4):
            C[at + a, at + b] += drift * drift * dot(by_force[a], by_force[b])
    C[at + 3, at + 3] += (drift / _normal_force(block, lane)) ** 2


@fused_kernel
def _fill_conditional_factor(known_count: int, scratch: KnownPriorScratch) -> None:
    """Rows of the factor of the other unknowns: with the covariance L L^T, L^-1 (c - c0 - gain (v - v0))."""
    L, U, size, places = scratch.covariance, scratch.factor, OTHERS * known_count, PLACES * known_count
    cholesky(L, size)
    below = U[places:]
    for a in range(size):
        below[a, places + a] = 1.0
        for b in range(places):
            below[a, b] = -scratch.gain[a, b]
    substitute_lower(L, size, below, places + size)


@fused_kernel
def _expand(
    prior: Prior,
    block: np.ndarray,
    U: np.ndarray,
    sizes: tuple[int, int, int],
    out: np.ndarray,
    lanes: tuple[int, int],
) -> None:
    """Rows of a known contact by its point, force, torsion and offset.

    `sizes`: numbers of rows and of known contacts, and which it is. `lanes`: as for
    `fill_rows`.
    """
    (size, known_count, i), (lane, end) = sizes, lanes
    s, t, by_force = vector_of(block, SX, lane), vector_of(block, TX, lane), _by_force(prior, block, lane)
    v, c = PLACES * i, PLACES * known_count + OTHERS * i
    for r in range(size):
        numbers = r * KNOWN_NUMBERS
        for k in range(3):
            force = 0.0
            if size > PLACES * known_count:
                for a in range(4):
                    force += U[r, c + a] * by_force[a][k]
            place = U[r, v] * s[k] + U[r, v + 1] * t[k]
            for j in range(lane, end):
                out[(numbers + k) * LANES + j], out[(numbers + 3 + k) * LANES + j] = place, force
        torsion, offset = 0.0, 0.0
        if size > PLACES * known_count:
            torsion = U[r, c + 3] / (prior.torsion_lever * _normal_force(block, lane))
            offset = U[r, c + 4] / block[OFFSET_STEP + lane]
        for j in range(lane, end):
            out[(numbers + 6) * LANES + j], out[(numbers + 7) * LANES + j] = torsion, offset
