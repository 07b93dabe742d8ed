"""Preallocated arrays of the search for several contacts."""

from typing import NamedTuple

import numpy as np

from contactsense.multi_contact.seed_samples import SeedSamples, choose_seed_samples
from contactsense.runtime.constants import Constants

MAX_CONTACTS = 3
"""Maximum number of simultaneous contacts."""
UNKNOWNS = 7
"""Unknowns of one contact: force (3), torsion, step along two tangents, offset of the surface."""
MAX_SEEDS = 24
"""Maximum number of seeds with the same number of contacts."""
BEAM_WIDTH = 48
"""Maximum number of pairs of samples that are extended by a third (beam search)."""
MAX_EXPLANATIONS = 3 * MAX_SEEDS + 1
"""Maximum number of explanations before ranking."""


class PrimitiveFrames(NamedTuple):
    """Body frames of all P primitives in the base frame."""

    rotation: np.ndarray
    """Shape (P, 3, 3)."""
    origin: np.ndarray
    """Shape (P, 3) [m]."""


class MeasurementRows(NamedTuple):
    """The measurement, whitened: value = sum over contacts of matrix[link] @ wrench, plus unit-variance
    noise."""

    matrix: np.ndarray
    """Rows that map a wrench on each link (about the base origin, base axes) to the values, shape (links,
    M, 6).

    Zero if the sensor does not measure contacts on the link.
    """
    value: np.ndarray
    """Shape (M,)."""
    seen: np.ndarray
    """1.0 if a row depends on contacts on a link, else 0.0, shape (links, M)."""
    factor: np.ndarray
    """Scratch: Cholesky factor of the base sensor's information matrix, shape (6, 6)."""
    row: np.ndarray
    """Scratch: a row before the correction for the motion of each link, shape (6,)."""
    transformed: np.ndarray
    """Scratch, shape (6,)."""


class KnownContacts(NamedTuple):
    """Contacts that are tracked already: priors of their points and, optionally, forces. Base frame."""

    primitive: np.ndarray
    """Index of the primitive among all of the arm, shape (MAX_CONTACTS,), int64."""
    point: np.ndarray
    """Point [m], shape (MAX_CONTACTS, 3)."""
    covariance: np.ndarray
    """Covariance of `point` [m^2]; its tangential part is used, shape (MAX_CONTACTS, 3, 3)."""
    force: np.ndarray
    """Previous force [N], shape (MAX_CONTACTS, 3)."""
    drift: np.ndarray
    """Standard deviation of the change of each force component since [N], shape (MAX_CONTACTS,).

    Infinity: the force has no prior of its own.
    """


class OptimizerState(NamedTuple):
    """Iterate and scratch of the joint optimization of several contacts; base frame."""

    primitive: np.ndarray
    """Shape (MAX_CONTACTS,), int64."""
    point: np.ndarray
    """Surface points [m], shape (MAX_CONTACTS, 3)."""
    frame: np.ndarray
    """Columns: outward normal and two tangents, shape (MAX_CONTACTS, 3, 3)."""
    force: np.ndarray
    """Forces on the robot [N], shape (MAX_CONTACTS, 3)."""
    torsion: np.ndarray
    """Moments about the outward normals [Nm], shape (MAX_CONTACTS,)."""
    offset: np.ndarray
    """Offset of the real surface from the primitive along the normal [m], shape (MAX_CONTACTS,)."""
    wrench: np.ndarray
    """Wrench of each contact about the base origin [N, Nm], shape (MAX_CONTACTS, 6)."""
    saved_point: np.ndarray
    """Iterate at which `matrix` was computed, shape (MAX_CONTACTS, 3). Fields `saved_` alike."""
    saved_frame: np.ndarray
    """Shape (MAX_CONTACTS, 3, 3)."""
    saved_force: np.ndarray
    """Shape (MAX_CONTACTS, 3)."""
    saved_torsion: np.ndarray
    """Shape (MAX_CONTACTS,)."""
    saved_offset: np.ndarray
    """Shape (MAX_CONTACTS,)."""
    prior_point: np.ndarray
    """Prior means of the points [m], shape (MAX_CONTACTS, 3)."""
    prior_point_information: np.ndarray
    """Their information matrices, zero without a prior [1/m^2], shape (MAX_CONTACTS, 3, 3)."""
    prior_force: np.ndarray
    """Prior means of the forces [N], shape (MAX_CONTACTS, 3)."""
    prior_force_information: np.ndarray
    """Their inverse variances, zero without a prior [1/N^2], shape (MAX_CONTACTS,)."""
    body: np.ndarray
    """Columns: normal, tangents and point of a contact in its primitive's body frame, shape (3, 4)."""
    wrench_jacobian: np.ndarray
    """Derivative of the wrenches about the base origin by the unknowns, shape (6, MAX_CONTACTS *
    UNKNOWNS)."""
    jacobian: np.ndarray
    """Derivative of the predicted rows by the unknowns, shape (M, MAX_CONTACTS * UNKNOWNS)."""
    residual: np.ndarray
    """Measured minus predicted rows, shape (M,)."""
    matrix: np.ndarray
    """Gauss-Newton matrix, then its Cholesky factor, lower triangle, shape (MAX_CONTACTS * UNKNOWNS,) *
    2."""
    inverse: np.ndarray
    """Inverse of the matrix, same shape."""
    step: np.ndarray
    """Gradient, then step, shape (MAX_CONTACTS * UNKNOWNS,)."""


class SeedingBuffers(NamedTuple):
    """Scratch of seeding."""

    point_normal: np.ndarray
    """Points [m] and outward normals of all samples, base frame, shape (S, 6)."""
    contact_covariance: np.ndarray
    """Covariance of the rows due to a contact at each coarse sample, shape (coarse, M, M)."""
    normal_jacobian: np.ndarray
    """Derivative of the rows by a force along the outward normal at each sample, shape (S, M)."""
    prior_covariance: np.ndarray
    """Covariance of the rows due to noise and known contacts, shape (M, M)."""
    pair_covariance: np.ndarray
    """The same plus one or two further contacts, shape (M, M)."""
    factor: np.ndarray
    """Cholesky factor of the covariance under test, lower triangle, shape (M, M)."""
    innovation: np.ndarray
    """Rows minus the prediction by the known forces, shape (M,)."""
    weighted_innovation: np.ndarray
    """Inverse covariance times innovation, shape (M,)."""
    force_jacobian: np.ndarray
    """Derivative of the rows by a force at one point, shape (M, 3)."""
    known_normal: np.ndarray
    """Outward normals of the known contacts, base axes, shape (MAX_CONTACTS, 3)."""
    initial_force: np.ndarray
    """Initial forces of a seed, base axes [N], shape (MAX_CONTACTS, 3)."""
    seed_score: np.ndarray
    """Log likelihood of each seed, in falling order, shape (MAX_SEEDS,)."""
    seed: np.ndarray
    """Its samples, shape (MAX_SEEDS, MAX_CONTACTS), int64."""
    beam_score: np.ndarray
    """As `seed_score`, for the pairs that are extended by a third sample, shape (BEAM_WIDTH,)."""
    beam: np.ndarray
    """Shape (BEAM_WIDTH, MAX_CONTACTS), int64."""


class Explanations(NamedTuple):
    """Sets of simultaneous contacts that explain one measurement, base frame. `order` lists the ranked
    ones."""

    order: np.ndarray
    """Rows by falling probability, shape (MAX_EXPLANATIONS,), int64."""
    contacts: np.ndarray
    """Number of contacts, shape (MAX_EXPLANATIONS,), int64."""
    score: np.ndarray
    """Log evidence, shape (MAX_EXPLANATIONS,)."""
    energy: np.ndarray
    """Half the squared residuals and priors, in units of the noise, shape (MAX_EXPLANATIONS,)."""
    probability: np.ndarray
    """Shape (MAX_EXPLANATIONS,)."""
    primitive: np.ndarray
    """Shape (MAX_EXPLANATIONS, MAX_CONTACTS), int64."""
    point: np.ndarray
    """Contact centroids [m], shape (MAX_EXPLANATIONS, MAX_CONTACTS, 3)."""
    normal: np.ndarray
    """Outward unit normals, shape (MAX_EXPLANATIONS, MAX_CONTACTS, 3)."""
    force: np.ndarray
    """Forces on the robot [N], shape (MAX_EXPLANATIONS, MAX_CONTACTS, 3)."""
    torsion: np.ndarray
    """Moments about the outward normals [Nm], shape (MAX_EXPLANATIONS, MAX_CONTACTS)."""
    covariance: np.ndarray
    """Covariance of each point [m^2], shape (MAX_EXPLANATIONS, MAX_CONTACTS, 3, 3)."""
    force_covariance: np.ndarray
    """Covariance of each force [N^2], shape (MAX_EXPLANATIONS, MAX_CONTACTS, 3, 3)."""
    wrench: np.ndarray
    """Sum of the wrenches about the base origin [N, Nm], shape (MAX_EXPLANATIONS, 6)."""
    wrench_covariance: np.ndarray
    """Its covariance, shape (MAX_EXPLANATIONS, 6, 6)."""


class MultiContactBuffers(NamedTuple):
    """All arrays of the search for several contacts, besides constants and state of the localizer."""

    seed_samples: SeedSamples
    rows: MeasurementRows
    known: KnownContacts
    optimizer: OptimizerState
    seeding: SeedingBuffers
    explanations: Explanations


def empty_multi_contact_buffers(constants: Constants) -> MultiContactBuffers:
    """Zero-filled arrays for one arm."""
    rows = 6 + constants.model.joints + 6 * len(constants.link_sensors.body)
    seed_samples = choose_seed_samples(constants)
    return MultiContactBuffers(
        seed_samples=seed_samples,
        rows=_empty_rows(rows, len(constants.touchable)),
        known=KnownContacts(
            primitive=np.zeros(MAX_CONTACTS, dtype=np.int64),
            point=np.zeros((MAX_CONTACTS, 3)),
            covariance=np.zeros((MAX_CONTACTS, 3, 3)),
            force=np.zeros((MAX_CONTACTS, 3)),
            drift=np.full(MAX_CONTACTS, np.inf),
        ),
        optimizer=_empty_optimizer(rows),
        seeding=_empty_seeding(rows, len(seed_samples.primitive), len(seed_samples.coarse)),
        explanations=_empty_explanations(),
    )


def _empty_rows(rows: int, links: int) -> MeasurementRows:
    return MeasurementRows(
        matrix=np.zeros((links, rows, 6)),
        value=np.zeros(rows),
        seen=np.zeros((links, rows)),
        factor=np.zeros((6, 6)),
        row=np.zeros(6),
        transformed=np.zeros(6),
    )


def _empty_optimizer(rows: int) -> OptimizerState:
    size = MAX_CONTACTS * UNKNOWNS
    return OptimizerState(
        primitive=np.zeros(MAX_CONTACTS, dtype=np.int64),
        point=np.zeros((MAX_CONTACTS, 3)),
        frame=np.zeros((MAX_CONTACTS, 3, 3)),
        force=np.zeros((MAX_CONTACTS, 3)),
        torsion=np.zeros(MAX_CONTACTS),
        offset=np.zeros(MAX_CONTACTS),
        wrench=np.zeros((MAX_CONTACTS, 6)),
        saved_point=np.zeros((MAX_CONTACTS, 3)),
        saved_frame=np.zeros((MAX_CONTACTS, 3, 3)),
        saved_force=np.zeros((MAX_CONTACTS, 3)),
        saved_torsion=np.zeros(MAX_CONTACTS),
        saved_offset=np.zeros(MAX_CONTACTS),
        prior_point=np.zeros((MAX_CONTACTS, 3)),
        prior_point_information=np.zeros((MAX_CONTACTS, 3, 3)),
        prior_force=np.zeros((MAX_CONTACTS, 3)),
        prior_force_information=np.zeros(MAX_CONTACTS),
        body=np.zeros((3, 4)),
        wrench_jacobian=np.zeros((6, size)),
        jacobian=np.zeros((rows, size)),
        residual=np.zeros(rows),
        matrix=np.zeros((size, size)),
        inverse=np.zeros((size, size)),
        step=np.zeros(size),
    )


def _empty_seeding(rows: int, samples: int, coarse: int) -> SeedingBuffers:
    return SeedingBuffers(
        point_normal=np.zeros((samples, 6)),
        contact_covariance=np.zeros((coarse, rows, rows)),
        normal_jacobian=np.zeros((samples, rows)),
        prior_covariance=np.zeros((rows, rows)),
        pair_covariance=np.zeros((rows, rows)),
        factor=np.zeros((rows, rows)),
        innovation=np.zeros(rows),
        weighted_innovation=np.zeros(rows),
        force_jacobian=np.zeros((rows, 3)),
        known_normal=np.zeros((MAX_CONTACTS, 3)),
        initial_force=np.zeros((MAX_CONTACTS, 3)),
        seed_score=np.zeros(MAX_SEEDS),
        seed=np.zeros((MAX_SEEDS, MAX_CONTACTS), dtype=np.int64),
        beam_score=np.zeros(BEAM_WIDTH),
        beam=np.zeros((BEAM_WIDTH, MAX_CONTACTS), dtype=np.int64),
    )


def _empty_explanations() -> Explanations:
    return Explanations(
        order=np.zeros(MAX_EXPLANATIONS, dtype=np.int64),
        contacts=np.zeros(MAX_EXPLANATIONS, dtype=np.int64),
        score=np.zeros(MAX_EXPLANATIONS),
        energy=np.zeros(MAX_EXPLANATIONS),
        probability=np.zeros(MAX_EXPLANATIONS),
        primitive=np.zeros((MAX_EXPLANATIONS, MAX_CONTACTS), dtype=np.int64),
        point=np.zeros((MAX_EXPLANATIONS, MAX_CONTACTS, 3)),
        normal=np.zeros((MAX_EXPLANATIONS, MAX_CONTACTS, 3)),
        force=np.zeros((MAX_EXPLANATIONS, MAX_CONTACTS, 3)),
        torsion=np.zeros((MAX_EXPLANATIONS, MAX_CONTACTS)),
        covariance=np.zeros((MAX_EXPLANATIONS, MAX_CONTACTS, 3, 3)),
        force_covariance=np.zeros((MAX_EXPLANATIONS, MAX_CONTACTS, 3, 3)),
        wrench=np.zeros((MAX_EXPLANATIONS, 6)),
        wrench_covariance=np.zeros((MAX_EXPLANATIONS, 6, 6)),
    )
