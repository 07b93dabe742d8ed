"""Where the joint optimization of a set of contacts starts: known contacts, and further ones at candidates or
at samples of the surface."""

import math

import numpy as np

from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.multi_contact.joint.contact_step import set_contact, vector_of
from contactsense.multi_contact.joint.known_rows import Known
from contactsense.multi_contact.likelihood.sample_likelihood import SampleModel, initial_forces
from contactsense.multi_contact.memory.buffers import (
    JointState,
    KnownContacts,
    MultiContactBuffers,
)
from contactsense.multi_contact.memory.joint_layout import (
    EXTENT,
    FORCE_PRIOR,
    FRICTION_RATIO,
    FX,
    MOMENT_PRIOR,
    NX,
    TILT,
    TORSION,
)
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.vectors import dot
from contactsense.solvers.posterior.contact_prior import Prior, pushing_force


@fused_kernel
def initialize_known_contact(
    surface: PlacedSurface,
    prior: Prior,
    known_contacts: KnownContacts,
    joint: JointState,
    known: Known,
    force_scale: float,
    lane: int,
    i: int,
) -> None:
    """Initialize contact i of a lane with known contact i.

    What is known of it is in `joint.known_rows`; extent of the primitive and tilt are part of that. If the
    force is a new one, the initial one is a push of the given scale [N].
    """
    c, f, block = known_contacts.point[i], known_contacts.force[i], joint.contact[i]
    point, force = (c[0], c[1], c[2]), (f[0], f[1], f[2])
    set_contact(surface, prior, joint, lane, i, known_contacts.primitive[i], point, force)
    n = vector_of(block, NX, lane)
    start = (-force_scale * n[0], -force_scale * n[1], -force_scale * n[2])
    if known.drift < math.inf:
        start = pushing_force(force, n)
        block[TORSION + lane] = known_contacts.torsion[i]
    block[EXTENT + lane], block[TILT + lane] = 0.0, 0.0
    for k in range(3):
        block[FX + k * LANES + lane] = start[k]
    weigh_priors(known, lane, block)


@fused_kernel
def weigh_priors(known: Known, lane: int, block: np.ndarray) -> None:
    """Set how much the priors that all contacts have count again for a known one in a lane.

    Those of torsion and offset are among `joint.known_rows`. In a stream that of the force counts in full:
    forces change much more in its course than between two samples.
    """
    if known.drift < math.inf:
        block[MOMENT_PRIOR + lane] = 0.0
        if known.measured:
            normal_force = -dot(vector_of(block, NX, lane), vector_of(block, FX, lane))
            deviation = block[FRICTION_RATIO + lane] * normal_force
            block[FORCE_PRIOR + lane] = new_share_of_prior(known.drift, deviation)


@fused_kernel
def new_share_of_prior(drift: float, deviation: float) -> float:
    """Weight with which the prior of a quantity counts again after the quantity has changed.

    The quantity a had the normal prior N(a; 0, s^2), which the earlier estimate contains. It has become b
    with p(b | a) = N(b; a, d^2) N(b; 0, s^2) / Z(a), Z(a) = N(a; 0, s^2 + d^2) up to a constant: of the
    changes, those against the prior are less probable. Where b is near a, N(b; 0, s^2) / Z(b) is the prior to
    the power d^2 / (s^2 + d^2). Without it, each sample would count the friction of the same force once more,
    and on a curved surface friction tells the place.

    Args:
        drift: Standard deviation d of the change.
        deviation: That of the prior, s.
    """
    return drift * drift / (drift * drift + deviation * deviation)


@fused_kernel
def initialize_further_contact(
    surface: PlacedSurface,
    prior: Prior,
    joint: JointState,
    primitive: int,
    point: np.ndarray,
    force: np.ndarray,
    lane: int,
    i: int,
) -> None:
    """Initialize contact i of a lane near a point [m] on a primitive, with the given force [N], base
    frame."""
    c, block = (point[0], point[1], point[2]), joint.contact[i]
    set_contact(surface, prior, joint, lane, i, primitive, c, (0.0, 0.0, 0.0))
    push = pushing_force((force[0], force[1], force[2]), vector_of(block, NX, lane))
    for k in range(3):
        block[FX + k * LANES + lane] = push[k]


@fused_kernel
def initialize_from_seed(
    surface: PlacedSurface,
    prior: Prior,
    model: SampleModel,
    buffers: MultiContactBuffers,
    counts: tuple[int, int],
    lane: int,
    s: int,
) -> None:
    """Initialize the further contacts of a lane at the samples of seed s, with their most likely forces.

    `counts`: numbers of known and of further contacts.
    """
    seed_samples, seeding, (known_count, further) = model.samples, buffers.seeding, counts
    initial_forces(model, s, further, seeding, seeding.initial_force)
    for e in range(further):
        i = seeding.seed[s, e]
        initialize_further_contact(
            surface,
            prior,
            buffers.joint,
            seed_samples.primitive[i],
            seeding.point_normal[i],
            seeding.initial_force[e],
            lane,
            known_count + e,
        )
