"""The arrays that the search for several contacts fills; made once, so that the search allocates nothing."""

from typing import NamedTuple

import numpy as np

from contactsense.arm import Arm
from contactsense.several.places import Choice, choose_places

MOST = 3
"""Most contacts at a time."""
UNKNOWNS = 7
"""Unknowns of one contact: force (3), torsion, step along two tangents, offset of the surface."""
SEEDS = 24
"""Most starts of the search with the same number of contacts."""
BEAM = 48
"""Most pairs of sampled places that are tried with a third."""
LISTED = 3 * SEEDS + 1
"""Most explanations before they are ranked."""


class Bodies(NamedTuple):
    """Where all P primitives are: their body frames in the base frame."""

    rotation: np.ndarray
    """Shape (P, 3, 3)."""
    origin: np.ndarray
    """Shape (P, 3) [m]."""


class Rows(NamedTuple):
    """The measurement in units of its noise: value = sum of the rows of each contact's link times its wrench,
    plus noise of variance one."""

    matrix: np.ndarray
    """What each row sees of a wrench on each link, about the base origin, base axes, zeros where it sees
    nothing, shape (links, M, 6)."""
    value: np.ndarray
    """Shape (M,)."""
    seen: np.ndarray
    """1.0 where a row sees contacts on a link, else 0.0, shape (links, M)."""
    factor: np.ndarray
    """Scratch: root of the base sensor's information, shape (6, 6)."""
    row: np.ndarray
    """Scratch: a row before it is turned for each link, shape (6,)."""
    turned: np.ndarray
    """Scratch, shape (6,)."""


class Known(NamedTuple):
    """Contacts that are tracked already: their places have a prior, and their forces may have one. Base
    frame."""

    primitive: np.ndarray
    """Number of the primitive among all of the arm, shape (MOST,), int64."""
    point: np.ndarray
    """Place [m], shape (MOST, 3)."""
    covariance: np.ndarray
    """Covariance of `point` [m^2]; what counts is its part in the tangent plane, shape (MOST, 3, 3)."""
    force: np.ndarray
    """Force before [N], shape (MOST, 3)."""
    drift: np.ndarray
    """Standard deviation of each component of the force's change since [N]; infinity: the force is free,
    shape (MOST,)."""


class Stack(NamedTuple):
    """State and scratch of the search with stacked contacts; base frame."""

    primitive: np.ndarray
    """Shape (MOST,), int64."""
    point: np.ndarray
    """Surface points [m], shape (MOST, 3)."""
    frame: np.ndarray
    """Columns: outward normal and two tangents, shape (MOST, 3, 3)."""
    force: np.ndarray
    """Forces on the robot [N], shape (MOST, 3)."""
    torsion: np.ndarray
    """Moments about the outward normals [Nm], shape (MOST,)."""
    offset: np.ndarray
    """How far the real surface lies outside the primitive [m], shape (MOST,)."""
    wrench: np.ndarray
    """Wrench of each contact about the base origin, shape (MOST, 6)."""
    kept_point: np.ndarray
    """As the fields without `kept_`: the contacts about which `matrix` was made, shape (MOST, 3)."""
    kept_frame: np.ndarray
    """Shape (MOST, 3, 3)."""
    kept_force: np.ndarray
    """Shape (MOST, 3)."""
    kept_torsion: np.ndarray
    """Shape (MOST,)."""
    kept_offset: np.ndarray
    """Shape (MOST,)."""
    prior_point: np.ndarray
    """Known places [m], shape (MOST, 3)."""
    prior_sharpness: np.ndarray
    """Their information matrices, zero where nothing is known [1/m^2], shape (MOST, 3, 3)."""
    prior_force: np.ndarray
    """Forces before [N], shape (MOST, 3)."""
    prior_stiffness: np.ndarray
    """Inverse variance of their changes [1/N^2], shape (MOST,)."""
    body: np.ndarray
    """Columns: normal, tangents and point of a contact in its primitive's body frame, shape (3, 4)."""
    wrench_map: np.ndarray
    """Change of the wrench about the base origin by the unknowns, shape (6, MOST * UNKNOWNS)."""
    jacobian: np.ndarray
    """Change of the rows by the unknowns, shape (M, MOST * UNKNOWNS)."""
    residual: np.ndarray
    """Rows minus what the contacts explain, shape (M,)."""
    matrix: np.ndarray
    """Gauss-Newton matrix, then its Cholesky factor, lower triangle, shape (MOST * UNKNOWNS,) * 2."""
    inverse: np.ndarray
    """Inverse of the matrix, same shape."""
    step: np.ndarray
    """Gradient, then step, shape (MOST * UNKNOWNS,)."""


class Scan(NamedTuple):
    """Scratch of the scan over sampled places."""

    place: np.ndarray
    """Points [m] and outward normals of all places, base frame, shape (S, 6)."""
    spread: np.ndarray
    """Covariance of the rows by a contact at each of the few places, shape (few, M, M)."""
    entering: np.ndarray
    """Rows by a unit force along the outward normal at each place, shape (S, M)."""
    ground: np.ndarray
    """Covariance of the rows by noise and known contacts, shape (M, M)."""
    pair: np.ndarray
    """The same and a pair of contacts, shape (M, M)."""
    factor: np.ndarray
    """Cholesky factor of the covariance that is tried, lower triangle, shape (M, M)."""
    innovation: np.ndarray
    """Rows minus what the known forces explain, shape (M,)."""
    weighed: np.ndarray
    """Inverse covariance times innovation, shape (M,)."""
    levers: np.ndarray
    """Rows by force at one place, shape (M, 3)."""
    normals: np.ndarray
    """Outward normals of the known contacts, base axes, shape (MOST, 3)."""
    pushes: np.ndarray
    """Forces to start with, base axes [N], shape (MOST, 3)."""
    seed_score: np.ndarray
    """Log likelihood of each seed, falling, shape (SEEDS,)."""
    seed: np.ndarray
    """Its places, shape (SEEDS, MOST), int64."""
    beam_score: np.ndarray
    """As `seed_score`, for the pairs that are tried with a third, shape (BEAM,)."""
    beam: np.ndarray
    """Shape (BEAM, MOST), int64."""


class Explanations(NamedTuple):
    """Sets of simultaneous contacts that explain one measurement, base frame; `order` lists those that
    count."""

    order: np.ndarray
    """Rows by falling probability, shape (LISTED,), int64."""
    contacts: np.ndarray
    """Number of contacts, shape (LISTED,), int64."""
    score: np.ndarray
    """Log evidence, shape (LISTED,)."""
    energy: np.ndarray
    """Half the squared residuals and priors, in units of the noise, shape (LISTED,)."""
    probability: np.ndarray
    """Shape (LISTED,)."""
    primitive: np.ndarray
    """Shape (LISTED, MOST), int64."""
    point: np.ndarray
    """Contact centroids [m], shape (LISTED, MOST, 3)."""
    normal: np.ndarray
    """Outward unit normals, shape (LISTED, MOST, 3)."""
    force: np.ndarray
    """Forces on the robot [N], shape (LISTED, MOST, 3)."""
    torsion: np.ndarray
    """Moments about the outward normals [Nm], shape (LISTED, MOST)."""
    covariance: np.ndarray
    """Covariance of each point [m^2], shape (LISTED, MOST, 3, 3)."""
    force_covariance: np.ndarray
    """Covariance of each force [N^2], shape (LISTED, MOST, 3, 3)."""
    wrench: np.ndarray
    """Sum of the wrenches about the base origin [N, Nm], shape (LISTED, 6)."""
    wrench_covariance: np.ndarray
    """Its covariance, shape (LISTED, 6, 6)."""


class Several(NamedTuple):
    """Everything that the search for several contacts needs beside arm and memory."""

    choice: Choice
    rows: Rows
    known: Known
    stack: Stack
    scan: Scan
    found: Explanations


def empty_several(arm: Arm) -> Several:
    """Arrays for one arm."""
    rows = 6 + arm.model.joints + 6
    choice = choose_places(arm)
    return Several(
        choice=choice,
        rows=_empty_rows(rows, len(arm.touchable)),
        known=Known(
            primitive=np.zeros(MOST, dtype=np.int64),
            point=np.zeros((MOST, 3)),
            covariance=np.zeros((MOST, 3, 3)),
            force=np.zeros((MOST, 3)),
            drift=np.full(MOST, np.inf),
        ),
        stack=_empty_stack(rows),
        scan=_empty_scan(rows, len(choice.primitive), len(choice.few)),
        found=_empty_explanations(),
    )


def _empty_rows(rows: int, links: int) -> Rows:
    return Rows(
        matrix=np.zeros((links, rows, 6)),
        value=np.zeros(rows),
        seen=np.zeros((links, rows)),
        factor=np.zeros((6, 6)),
        row=np.zeros(6),
        turned=np.zeros(6),
    )


def _empty_stack(rows: int) -> Stack:
    size = MOST * UNKNOWNS
    return Stack(
        primitive=np.zeros(MOST, dtype=np.int64),
        point=np.zeros((MOST, 3)),
        frame=np.zeros((MOST, 3, 3)),
        force=np.zeros((MOST, 3)),
        torsion=np.zeros(MOST),
        offset=np.zeros(MOST),
        wrench=np.zeros((MOST, 6)),
        kept_point=np.zeros((MOST, 3)),
        kept_frame=np.zeros((MOST, 3, 3)),
        kept_force=np.zeros((MOST, 3)),
        kept_torsion=np.zeros(MOST),
        kept_offset=np.zeros(MOST),
        prior_point=np.zeros((MOST, 3)),
        prior_sharpness=np.zeros((MOST, 3, 3)),
        prior_force=np.zeros((MOST, 3)),
        prior_stiffness=np.zeros(MOST),
        body=np.zeros((3, 4)),
        wrench_map=np.zeros((6, size)),
        jacobian=np.zeros((rows, size)),
        residual=np.zeros(rows),
        matrix=np.zeros((size, size)),
        inverse=np.zeros((size, size)),
        step=np.zeros(size),
    )


def _empty_scan(rows: int, places: int, few: int) -> Scan:
    return Scan(
        place=np.zeros((places, 6)),
        spread=np.zeros((few, rows, rows)),
        entering=np.zeros((places, rows)),
        ground=np.zeros((rows, rows)),
        pair=np.zeros((rows, rows)),
        factor=np.zeros((rows, rows)),
        innovation=np.zeros(rows),
        weighed=np.zeros(rows),
        levers=np.zeros((rows, 3)),
        normals=np.zeros((MOST, 3)),
        pushes=np.zeros((MOST, 3)),
        seed_score=np.zeros(SEEDS),
        seed=np.zeros((SEEDS, MOST), dtype=np.int64),
        beam_score=np.zeros(BEAM),
        beam=np.zeros((BEAM, MOST), dtype=np.int64),
    )


def _empty_explanations() -> Explanations:
    return Explanations(
        order=np.zeros(LISTED, dtype=np.int64),
        contacts=np.zeros(LISTED, dtype=np.int64),
        score=np.zeros(LISTED),
        energy=np.zeros(LISTED),
        probability=np.zeros(LISTED),
        primitive=np.zeros((LISTED, MOST), dtype=np.int64),
        point=np.zeros((LISTED, MOST, 3)),
        normal=np.zeros((LISTED, MOST, 3)),
        force=np.zeros((LISTED, MOST, 3)),
        torsion=np.zeros((LISTED, MOST)),
        covariance=np.zeros((LISTED, MOST, 3, 3)),
        force_covariance=np.zeros((LISTED, MOST, 3, 3)),
        wrench=np.zeros((LISTED, 6)),
        wrench_covariance=np.zeros((LISTED, 6, 6)),
    )
