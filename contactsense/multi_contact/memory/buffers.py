"""Preallocated arrays of the search for several contacts."""

from typing import Annotated, NamedTuple

from contactsense.isolation.link_hypotheses import Hypotheses
from contactsense.localization.candidates.candidate_buffers import MAX_CANDIDATES, Candidates
from contactsense.multi_contact.memory.joint_layout import CONTACT_LENGTH, LANE_NUMBERS
from contactsense.multi_contact.memory.pair_layout import FIRST_LENGTH, PAIR_LENGTH, PAIRS
from contactsense.multi_contact.memory.sample_layout import BLOCK_LENGTH
from contactsense.multi_contact.memory.seed_samples import SeedSamples, choose_seed_samples
from contactsense.robots.jit.declaration import Floats, Integers
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.robots.jit.lanes import LANES
from contactsense.scene_model.constants import Constants

MAX_CONTACTS = 3
"""Maximum number of simultaneous contacts."""
PLACES, OTHERS = 2, 5
"""Unknowns of one contact: steps along two tangents; and force (3), torsion, offset of the surface."""
UNKNOWNS = PLACES + OTHERS
"""All of them, in the order force, torsion, steps, offset."""
KNOWN_NUMBERS = 8
"""Numbers of a known contact: point (3), force (3), torsion, offset of the surface."""
COVARIANCE_ROOTS = 2 * MAX_CONTACTS + 6
"""Of the place of each contact (2), and of the sum of the wrenches (6)."""
MAX_SEEDS = 24
"""Maximum number of seeds with the same number of contacts."""
BEAM_WIDTH = 48
"""Maximum number of pairs of samples that are extended by a third (beam search)."""
MAX_SUMMED_PAIRS = 12
"""Maximum number of pairs of links without an optimum that are explanations."""
MAX_EXPLANATIONS = 3 * MAX_SEEDS + 1 + max(MAX_SUMMED_PAIRS, LANES)
"""Maximum number of explanations before ranking. Pairs of links without an optimum are some only where
nothing was known before; where something was, a block behind them is scratch."""


class MeasurementRows(NamedTuple):
    """The measurement, whitened: value = sum over contacts of matrix[link] @ wrench, plus unit-variance
    noise."""

    matrix: Annotated[Floats, "links, rows, 6"]
    """Rows that map a wrench on each link (about the base origin, base axes) to the values. Zero if the
    sensor does not measure contacts on the link."""
    value: Annotated[Floats, "rows"]
    seen: Annotated[Floats, "links, rows"]
    """1.0 if a row depends on contacts on a link, else 0.0."""
    factor: Annotated[Floats, "6, 6"]
    """Scratch: Cholesky factor of the base sensor's information matrix."""
    row: Annotated[Floats, "6"]
    """Scratch: a row before the correction for the motion of each link."""
    transformed: Annotated[Floats, "6"]
    """Scratch."""


class Measurement(NamedTuple):
    """One measurement: the first rows of the arrays."""

    rows: MeasurementRows
    size: int
    """Number of rows. It differs from sample to sample, as sensors fail, and the arrays keep their size."""


class KnownContacts(NamedTuple):
    """Contacts that are known already, base frame."""

    primitive: Annotated[Integers, f"{MAX_CONTACTS}"]
    """Index of the primitive among all of the arm."""
    point: Annotated[Floats, f"{MAX_CONTACTS}, 3"]
    """Point [m]."""
    covariance: Annotated[Floats, f"{MAX_CONTACTS}, 3, 3"]
    """Covariance of `point` [m^2]. Where it is narrow, its tangential part is used; see
    `contactsense.multi_contact.known_contacts.known_place_mixture`."""
    force: Annotated[Floats, f"{MAX_CONTACTS}, 3"]
    """Previous force [N]."""
    torsion: Annotated[Floats, f"{MAX_CONTACTS}"]
    """Previous moment about the outward normal [Nm]."""


class KnownPriorScratch(NamedTuple):
    """Scratch of the prior of known contacts, see `contactsense.multi_contact.known_contacts.known_prior`."""

    information: Annotated[Floats, f"{OTHERS} * {MAX_CONTACTS}, {OTHERS} * {MAX_CONTACTS}"]
    """Of the other unknowns given the places, then its Cholesky factor."""
    gain: Annotated[Floats, f"{OTHERS} * {MAX_CONTACTS}, {PLACES} * {MAX_CONTACTS}"]
    """Derivative of the mean of the other unknowns by the places."""
    covariance: Annotated[Floats, f"{OTHERS} * {MAX_CONTACTS}, {OTHERS} * {MAX_CONTACTS}"]
    """Of the other unknowns given the places, then its Cholesky factor."""
    factor: Annotated[Floats, f"{UNKNOWNS} * {MAX_CONTACTS}, {UNKNOWNS} * {MAX_CONTACTS}"]
    """Factor of the information on all unknowns, the places first; lower triangle."""
    whitened: Annotated[Floats, f"rows, {UNKNOWNS} * {MAX_CONTACTS}"]
    """Derivative of the measured rows by the unknowns, divided by the factor."""
    earlier: Annotated[Floats, "rows"]
    """What the earlier sample measured, see `contactsense.multi_contact.known_contacts.known_components`."""
    place_covariance: Annotated[Floats, f"{MAX_CONTACTS}, 3, 3"]
    """Covariances of the known places where that of one is a component [m^2]."""
    primitive: Annotated[Integers, f"{LANES}"]
    """Primitive of each component."""
    evidence: Annotated[Floats, f"{LANES}"]
    """Log evidence of the known contacts with each component, before the measurement."""


class JointState(NamedTuple):
    """Iterates and scratch of the joint optimization, eight sets of contacts at a time, see
    `contactsense.multi_contact.memory.joint_layout`. Base frame."""

    primitive: Annotated[Integers, f"{MAX_CONTACTS}, {LANES}"]
    """Primitive of each contact."""
    cell: Annotated[Integers, f"{MAX_CONTACTS}, {LANES}"]
    """Cell of its surface, see `contactsense.localization.surface.local_prior.DeviationCells`; -1 without
    cells."""
    contact: Annotated[Floats, f"{MAX_CONTACTS}, {CONTACT_LENGTH}"]
    """Everything about each contact."""
    lane: Annotated[Floats, f"{LANE_NUMBERS}, {LANES}"]
    """Energies and flags."""
    rows: Annotated[Floats, f"{MAX_CONTACTS}, 6 * {LANES} * rows"]
    """Rows of the link of each contact, six numbers for each."""
    jacobian: Annotated[Floats, f"{MAX_CONTACTS} * {UNKNOWNS}, {LANES} * rows"]
    """Derivative of the predicted rows by the unknowns."""
    known_mean: Annotated[Floats, f"{MAX_CONTACTS}, {KNOWN_NUMBERS} * {LANES}"]
    """Point [m], force [N], torsion [Nm] and offset [m] of each known contact before the measurement, in each
    lane."""
    known_rows: Annotated[Floats, f"{MAX_CONTACTS}, {KNOWN_NUMBERS} * {LANES} * {UNKNOWNS} * {MAX_CONTACTS}"]
    """Rows of the prior of known contacts: eight numbers of each, by what differs from `known_mean`; in each
    lane."""
    known_jacobian: Annotated[Floats, f"{MAX_CONTACTS} * {UNKNOWNS}, {LANES} * {UNKNOWNS} * {MAX_CONTACTS}"]
    """Derivative of these rows by the unknowns."""
    known_residual: Annotated[Floats, f"{LANES} * {UNKNOWNS} * {MAX_CONTACTS}"]
    """These rows, of the difference to `known_mean`."""
    residual: Annotated[Floats, f"{LANES} * rows"]
    """Measured minus predicted rows."""
    saved_residual: Annotated[Floats, f"{LANES} * rows"]
    """The same at the iterate at which `matrix` was computed."""
    excess: Annotated[Floats, f"{LANES} * rows"]
    """Scratch: residual beyond the linear model."""
    matrix: Annotated[Floats, f"{MAX_CONTACTS} * {UNKNOWNS}, {MAX_CONTACTS} * {UNKNOWNS} * {LANES}"]
    """Gauss-Newton matrices, then their Cholesky factors without diagonals, lower triangles."""
    pivot: Annotated[Floats, f"{MAX_CONTACTS} * {UNKNOWNS} * {LANES}"]
    """Squares of the diagonals."""
    inverse_diagonal: Annotated[Floats, f"{MAX_CONTACTS} * {UNKNOWNS} * {LANES}"]
    """Inverse diagonals."""
    step: Annotated[Floats, f"{MAX_CONTACTS} * {UNKNOWNS} * {LANES}"]
    """Gradients, then steps."""
    corrected_step: Annotated[Floats, f"{MAX_CONTACTS} * {UNKNOWNS} * {LANES}"]
    """Steps, corrected for the curvature of the measurement along them."""
    root: Annotated[Floats, f"{COVARIANCE_ROOTS}, {MAX_CONTACTS} * {UNKNOWNS} * {LANES}"]
    """Scratch of the covariances."""
    covariance: Annotated[Floats, f"{COVARIANCE_ROOTS} * {COVARIANCE_ROOTS} * {LANES}"]
    """Covariances of the place of each contact, in its frame, and of the sum of the wrenches."""


class SeedingBuffers(NamedTuple):
    """Scratch of seeding."""

    point_normal: Annotated[Floats, "samples, 6"]
    """Points [m] and outward normals of all samples, base frame."""
    contact_covariance: Annotated[Floats, "coarse, rows, rows"]
    """Covariance of the rows due to a contact at each coarse sample."""
    normal_jacobian: Annotated[Floats, "samples, rows"]
    """Derivative of the rows by a force along the outward normal at each sample."""
    prior_covariance: Annotated[Floats, "rows, rows"]
    """Covariance of the rows due to noise and known contacts."""
    given_covariance: Annotated[Floats, "rows, rows"]
    """The same plus one or two further contacts."""
    known_jacobian: Annotated[Floats, f"rows, {3 * (MAX_CONTACTS - 1)}"]
    """Derivative of the rows by the free forces of known contacts, in units of their prior: along the outward
    normal, and along two tangents."""
    known_root: Annotated[Floats, f"rows, {3 * (MAX_CONTACTS - 1)}"]
    """Scratch: the same, divided by the factor."""
    known_force: Annotated[Floats, f"{3 * (MAX_CONTACTS - 1)}"]
    """Scratch: mean of these forces ..."""
    known_force_factor: Annotated[Floats, f"{3 * (MAX_CONTACTS - 1)}, {3 * (MAX_CONTACTS - 1)}"]
    """... Cholesky factor of their covariance ..."""
    known_force_point: Annotated[Floats, f"{3 * (MAX_CONTACTS - 1)}"]
    """... and one value of them."""
    factor: Annotated[Floats, "rows, rows"]
    """Cholesky factor of the covariance under test, lower triangle."""
    innovation: Annotated[Floats, "rows"]
    """Rows minus the prediction by the known forces."""
    weighted_innovation: Annotated[Floats, "rows"]
    """Inverse covariance times innovation."""
    whitened: Annotated[Floats, "rows, 6 * links"]
    """Derivative of the rows, divided by the factor, by a wrench on each link."""
    link_information: Annotated[Floats, "links, 6, 6"]
    """Information matrix of the wrench of a further contact on each link."""
    link_vector: Annotated[Floats, "links, 6"]
    """That matrix times the most likely wrench."""
    cross_information: Annotated[Floats, "links, 6, 6 * links"]
    """Information that the rows share on the wrenches of two contacts: of link k >= l in 6 rows and
    columns."""
    first: Annotated[Floats, f"{FIRST_LENGTH}"]
    """A block of first contacts, see `contactsense.multi_contact.memory.pair_layout`."""
    moment_deviation: Annotated[Floats, "links"]
    """Standard deviation of each component of the additional moment of a contact [Nm]."""
    hypotheses: Hypotheses
    """The wrench of a single further contact on each link."""
    link_probability: Annotated[Floats, "links"]
    """Probability of each link for it."""
    block: Annotated[Floats, f"blocks, {BLOCK_LENGTH}"]
    """Blocks of samples."""
    force_jacobian: Annotated[Floats, "rows, 3"]
    """Derivative of the rows by a force at one point."""
    initial_force: Annotated[Floats, f"{MAX_CONTACTS}, 3"]
    """Initial forces of a seed, base axes [N]."""
    pair_evidence: Annotated[Floats, "links, links"]
    """Log evidence of two contacts on each pair of links, k >= l in row k, up to a constant."""
    pair_gain: Annotated[Floats, "links, links"]
    """Highest `GAIN` on each pair of links."""
    pair_sum: Annotated[Floats, "links, links"]
    """Sum of the likelihoods on each pair of links, relative to exp(`pair_gain`)."""
    pair: Annotated[Floats, f"{PAIR_LENGTH}"]
    """Scratch: the pairs of two blocks, see `contactsense.multi_contact.memory.pair_layout`."""
    pair_likelihood: Annotated[Floats, f"blocks, blocks, {PAIRS}"]
    """Likelihood of each pair of samples of two blocks, the one on the farther link first; negative
    where not both push, zero where there is no such pair."""
    pair_reference: Annotated[Floats, "blocks, blocks"]
    """Logarithm to which they are relative, as `GAIN`; -infinity where all are negligible."""
    pair_bound: Annotated[Floats, "blocks, blocks"]
    """Scratch: upper bound of the logarithm of the likelihoods that push; -infinity where none is left."""
    place_likelihood: Annotated[Floats, "2, coarse"]
    """Likelihood of each sample as the place of a contact, wherever the other one is: of the contact on the
    farther link, of the other. The sums are one."""
    sample_order: Annotated[Floats, "coarse"]
    """Scratch: how far each sample is in one direction."""
    place_covariance: Annotated[Floats, "3, 3"]
    """Scratch: covariance of the place of a contact [m^2]."""
    wrench_prior: Annotated[Floats, "6, 6"]
    """Prior covariance of the wrench of a contact near a sample."""
    wrench_root: Annotated[Floats, "rows, 6"]
    """Covariance of the rows and the sum of the wrenches, divided by the factor."""
    seed_score: Annotated[Floats, f"{MAX_SEEDS}"]
    """Log likelihood of each seed, in falling order."""
    seed: Annotated[Integers, f"{MAX_SEEDS}, {MAX_CONTACTS}"]
    """Its samples."""
    beam_score: Annotated[Floats, f"{BEAM_WIDTH}"]
    """As `seed_score`, for the pairs that are extended by a third sample."""
    beam: Annotated[Integers, f"{BEAM_WIDTH}, {MAX_CONTACTS}"]


class Explanations(NamedTuple):
    """Sets of simultaneous contacts that explain one measurement, base frame. `order` lists the ranked
    ones."""

    order: Annotated[Integers, f"{MAX_EXPLANATIONS}"]
    """Rows by falling probability, but for the first one, see
    `contactsense.multi_contact.explanations.ranked_sets`."""
    contacts: Annotated[Integers, f"{MAX_EXPLANATIONS}"]
    """Number of contacts."""
    log_evidence: Annotated[Floats, f"{MAX_EXPLANATIONS}"]
    """Log evidence of the optimum alone; -infinity without one."""
    score: Annotated[Floats, f"{MAX_EXPLANATIONS}"]
    """Log evidence with what else is known about the places near it, by which they are ranked."""
    energy: Annotated[Floats, f"{MAX_EXPLANATIONS}"]
    """Half the squared residuals and priors, in units of the noise."""
    probability: Annotated[Floats, f"{MAX_EXPLANATIONS}"]
    primitive: Annotated[Integers, f"{MAX_EXPLANATIONS}, {MAX_CONTACTS}"]
    point: Annotated[Floats, f"{MAX_EXPLANATIONS}, {MAX_CONTACTS}, 3"]
    """Contact centroids [m]."""
    normal: Annotated[Floats, f"{MAX_EXPLANATIONS}, {MAX_CONTACTS}, 3"]
    """Outward unit normals."""
    force: Annotated[Floats, f"{MAX_EXPLANATIONS}, {MAX_CONTACTS}, 3"]
    """Forces on the robot [N]."""
    torsion: Annotated[Floats, f"{MAX_EXPLANATIONS}, {MAX_CONTACTS}"]
    """Moments about the outward normals [Nm]."""
    covariance: Annotated[Floats, f"{MAX_EXPLANATIONS}, {MAX_CONTACTS}, 3, 3"]
    """Covariance of each point [m^2]."""
    wrench: Annotated[Floats, f"{MAX_EXPLANATIONS}, 6"]
    """Sum of the wrenches about the base origin [N, Nm]."""
    wrench_covariance: Annotated[Floats, f"{MAX_EXPLANATIONS}, 6, 6"]
    """Its covariance."""


class Rank(NamedTuple):
    """Scratch of the rank of a set of contacts."""

    link: Annotated[Integers, f"{MAX_CONTACTS}"]
    """Their links."""
    matrix: Annotated[Floats, f"rows, 6 * {MAX_CONTACTS}"]
    """What the rows measure of their wrenches."""


class MultiContactBuffers(NamedTuple):
    """All arrays of the search for several contacts, besides constants and state of the localizer."""

    seed_samples: SeedSamples
    rows: MeasurementRows
    known: KnownContacts
    known_prior: KnownPriorScratch
    joint: JointState
    rank: Rank
    seeding: SeedingBuffers
    candidates: Candidates
    """Of a single further contact."""
    explanations: Explanations


def empty_multi_contact_buffers(constants: Constants) -> MultiContactBuffers:
    """Arrays for one arm, without known contacts."""
    seed_samples = choose_seed_samples(constants)
    buffers = zeros(
        MultiContactBuffers,
        links=len(constants.touchable),
        rows=6 + constants.model.joints + 6 * len(constants.link_sensors.body),
        samples=len(seed_samples.primitive),
        coarse=seed_samples.coarse.sample.size,
        blocks=len(seed_samples.coarse.link),
        primitives=len(constants.surfaces.kind),
        candidates=max(len(constants.surfaces.kind), MAX_CANDIDATES),
    )
    return buffers._replace(seed_samples=seed_samples)
