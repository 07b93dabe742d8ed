"""What a sample tells of contacts that an earlier one has measured, against dense linear algebra."""

import numpy as np
import pytest

from contactsense.multi_contact.joint.contact_step import vector_of
from contactsense.multi_contact.joint.known_rows import Known, KnownRows
from contactsense.multi_contact.memory.buffers import UNKNOWNS
from contactsense.multi_contact.memory.joint_layout import (
    ACTIVE,
    FORCE_PRIOR,
    FX,
    JACOBIAN,
    MOMENT_PRIOR,
    NX,
    SX,
    TORSION,
    TX,
)
from contactsense.robots.jit.lanes import LANES
from tests.contactsense.multi_contact.smooth_arm import Case, draw_known, empty_case

pytestmark = pytest.mark.slow  # its kernels compile for long

PLACE, OTHER = [4, 5], [0, 1, 2, 3, 6]
"""Unknowns of a contact."""


@pytest.fixture(scope="module")
def case() -> Case:
    return empty_case()


def _unknowns(of_each: list[int], count: int) -> np.ndarray:
    return np.concatenate([i * UNKNOWNS + np.array(of_each) for i in range(count)])


def _matrix(case: Case, m: int, known: KnownRows, count: int) -> np.ndarray:
    """Gauss-Newton matrix of the contacts in lane 0."""
    joint, problem = case.buffers.joint, case.problem(m, count, known)
    joint.lane[ACTIVE] = 1.0
    case.steps.linearize(problem)
    size = count * UNKNOWNS
    lower = np.tril(joint.matrix.reshape(len(joint.matrix), -1, LANES)[:size, :size, 0])
    return np.asarray(lower + np.tril(lower, -1).T)


def _contacts(case: Case, count: int) -> int:
    """Contacts and their measurement; they are also the known ones. Number of rows."""
    trial, m = draw_known(case, count)
    for i, push in enumerate(trial.pushes):
        case.buffers.joint.contact[i, TORSION : TORSION + LANES] = push.torsion
    return m


def _state(case: Case, covariance: np.ndarray, count: int) -> None:
    """State the covariances of the known places, along two tangents each, shape (2 count, 2 count)."""
    for i in range(count):
        block = case.buffers.joint.contact[i]
        tangents = np.array([vector_of(block, SX, 0), vector_of(block, TX, 0)])
        part = covariance[2 * i : 2 * i + 2, 2 * i : 2 * i + 2]
        case.buffers.known.covariance[i] = tangents.T @ part @ tangents


def _prior(case: Case, m: int, count: int, drift: float, measured: bool = True) -> KnownRows:
    return case.steps.fill_known_prior(case.problem(m, count), Known(count, drift, measured))


def test_two_samples_of_an_unchanged_contact_tell_as_much_as_one_with_twice_the_information(
    case: Case,
) -> None:
    """Its priors count once, not once for each sample."""
    for _ in range(20):
        m = _contacts(case, 1)
        first = _matrix(case, m, KnownRows(0, 0), 1)
        from_rows = first - _matrix(case, 0, KnownRows(0, 0), 1)
        _state(case, np.linalg.inv(first)[np.ix_(PLACE, PLACE)], 1)
        known = _prior(case, m, 1, 1e-3)
        second = np.linalg.inv(_matrix(case, m, known, 1))
        expected = np.linalg.inv(first + from_rows)
        np.testing.assert_allclose(
            second[np.ix_(PLACE, PLACE)], expected[np.ix_(PLACE, PLACE)], rtol=0.02, atol=2e-8
        )


@pytest.mark.parametrize("drift", [0.1, np.inf])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_without_a_further_measurement_the_places_stay_as_uncertain_as_they_were(
    case: Case, count: int, drift: float
) -> None:
    """What the earlier estimate has concluded from friction does not count again."""
    m = _contacts(case, count)
    places = 0.01**2 * np.eye(2 * count)
    _state(case, places, count)
    known = _prior(case, m, count, drift)
    v = _unknowns(PLACE, count)
    stated = np.linalg.inv(_matrix(case, 0, known, count))[np.ix_(v, v)]
    np.testing.assert_allclose(stated, places, rtol=0.02, atol=0.02 * 0.01**2)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_what_is_known_is_the_places_as_stated_and_the_rest_as_measured_given_them(
    case: Case, count: int
) -> None:
    m, drift = _contacts(case, count), 0.5
    H = _matrix(case, m, KnownRows(0, 0), count)
    joint = case.buffers.joint
    rng = np.random.default_rng(count)
    root = 0.01 * rng.standard_normal((count, 2, 2))
    places = np.zeros((2 * count, 2 * count))
    by_force = np.zeros((5 * count, 3 * count))
    for i in range(count):
        places[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = root[i] @ root[i].T
        block, prior = joint.contact[i], case.constants.prior
        # The wrench begins with the force.
        force = block[JACOBIAN : JACOBIAN + 42 * LANES].reshape(7, 6, LANES)[:3, :3, 0].T
        by_force[5 * i : 5 * i + 3, 3 * i : 3 * i + 3] = np.linalg.inv(force)
        normal_force = -np.dot(vector_of(block, NX, 0), vector_of(block, FX, 0))
        torsion_ratio = block[TORSION] / (prior.torsion_lever * normal_force)
        by_force[5 * i + 3, 3 * i : 3 * i + 3] = -torsion_ratio * by_force[5 * i, 3 * i : 3 * i + 3]
    _state(case, places, count)
    known = _prior(case, m, count, drift)
    v, c = _unknowns(PLACE, count), _unknowns(OTHER, count)
    given = np.linalg.inv(H[np.ix_(c, c)])
    gain = -given @ H[np.ix_(c, v)]
    given = given + drift**2 * by_force @ by_force.T
    for i in range(count):
        block = joint.contact[i]
        F = -np.dot(vector_of(block, NX, 0), vector_of(block, FX, 0))
        given[5 * i + 3, 5 * i + 3] += (drift / F) ** 2
    places += 1e-8 * np.eye(2 * count)
    expected = np.zeros_like(H)
    expected[np.ix_(v, v)] = places
    expected[np.ix_(c, v)] = gain @ places
    expected[np.ix_(v, c)] = (gain @ places).T
    expected[np.ix_(c, c)] = given + gain @ places @ gain.T
    for i in range(count):
        # Without what the priors of all contacts add.
        joint.contact[i].reshape(-1, LANES)[[FORCE_PRIOR // LANES, MOMENT_PRIOR // LANES]] = 0.0
    stated = np.linalg.inv(_matrix(case, 0, known, count))
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(stated / scale / scale[:, None], expected / scale / scale[:, None], atol=1e-6)


@pytest.mark.parametrize("measured", [True, False])
@pytest.mark.parametrize("drift", [0.5, np.inf])
def test_what_is_known_is_centred_on_the_known_contacts(case: Case, drift: float, measured: bool) -> None:
    m = _contacts(case, 2)
    _state(case, 1e-4 * np.eye(4), 2)
    known = _prior(case, m, 2, drift, measured)
    _matrix(case, m, known, 2)
    np.testing.assert_allclose(
        case.buffers.joint.known_residual[: known.rows * LANES : LANES], 0.0, atol=1e-9
    )
