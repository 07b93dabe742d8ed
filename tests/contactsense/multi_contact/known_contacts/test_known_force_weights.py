"""Candidates beside which a known contact would have to pull are improbable."""

import math

import numpy as np
import pytest
from scipy.stats import multivariate_t

from contactsense.benchmarks.multi_contact.calibration import SCENARIOS, judge
from contactsense.benchmarks.multi_contact.measure import localizer_for
from contactsense.benchmarks.multi_contact.mesh_trials import MeshTrials
from contactsense.benchmarks.static_truth.cases import COLUMNS
from contactsense.localization.candidates.candidate_buffers import Candidates
from contactsense.multi_contact.joint.known_rows import Known
from contactsense.multi_contact.known_contacts.known_force_weights import (
    candidate_weight,
    fill_known_forces,
    prior_ratio,
    weigh_by_known_forces,
)
from contactsense.multi_contact.likelihood.link_information import log_likelihood
from contactsense.multi_contact.likelihood.sample_likelihood import RATIO_FACTOR, force_deviations
from contactsense.multi_contact.memory.buffers import MultiContactBuffers
from contactsense.multi_contact.memory.joint_layout import NX
from contactsense.multi_contact.seeding.seeding_prior import initialize_seeding
from contactsense.robots.jit.lanes import LANES
from contactsense.solvers.posterior.contact_prior import STUDENT_DOF
from tests.contactsense.multi_contact.random_measurement import ROWS, model_of, random_measurement
from tests.shared import shared

pytestmark = pytest.mark.slow  # its kernels compile for long

FRICTION_RATIO = 0.35
FORCE = 20.0
LINK = 4
PLACES = 6


def _beside(known: int, scale: float = 1.0) -> MultiContactBuffers:
    """A measurement of known contacts on one link and of the first of some candidates on another one.

    `scale`: Of all readings.
    """
    buffers, _, noise = random_measurement(1.0)
    rng = np.random.default_rng(6)
    for block in buffers.joint.contact:
        block[:] = rng.standard_normal(block.shape)
        normal = rng.standard_normal(3)
        block[NX : NX + 3 * LANES : LANES] = normal / np.linalg.norm(normal)
    buffers.known.covariance[:known] = np.diag((4e-4, 1e-4, 1e-6))
    buffers.known.force[:known] = (0.0, 0.6 * FORCE, -0.8 * FORCE)
    candidates = buffers.candidates
    candidates.order[:PLACES] = np.arange(PLACES)
    candidates.primitive[:PLACES] = 1
    candidates.probability[:PLACES] = (0.3, 0.25, 0.2, 0.15, 0.07, 0.03)
    candidates.point[:PLACES] = rng.standard_normal((PLACES, 3))
    normals = rng.standard_normal((PLACES, 3))
    candidates.normal[:PLACES] = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    candidates.force[:PLACES] = -FORCE * candidates.normal[:PLACES]
    candidates.covariance[:PLACES] = 1e-4 * np.eye(3)
    links, seeding = _links(buffers), buffers.seeding
    initialize_seeding(links, model_of(buffers, FRICTION_RATIO, FORCE), buffers, Known(known, math.inf, True))
    pushes = np.tile((-0.8, 0.3, -0.2), known)
    first = _by_force(buffers, 0) @ candidates.force[0]
    seeding.innovation[:] = scale * (noise + first + seeding.known_jacobian[:, : 3 * known] @ pushes)
    return buffers


def _by_force(buffers: MultiContactBuffers, row: int) -> np.ndarray:
    """Derivative of the rows by a force at a candidate."""
    A, c = buffers.rows.matrix[LINK], buffers.candidates.point[row]
    return np.asarray(A[:, :3] + A[:, 3:] @ np.array([[0, -c[2], c[1]], [c[2], 0, -c[0]], [-c[1], c[0], 0]]))


def _links(buffers: MultiContactBuffers) -> np.ndarray:
    """Known contacts are on primitive 0."""
    links = np.full(len(buffers.candidates.primitive), LINK)
    links[0] = 2
    return links


def _weigh(buffers: MultiContactBuffers, known: int) -> Candidates:
    model = model_of(buffers, FRICTION_RATIO, FORCE)
    weigh_by_known_forces(_links(buffers), model, known, buffers.candidates, PLACES, buffers.seeding)
    return buffers.candidates


def _expected_weight(buffers: MultiContactBuffers, row: int, known: int) -> float:
    """That of a candidate by dense linear algebra and many random forces."""
    seeding, candidates, A = buffers.seeding, buffers.candidates, buffers.rows.matrix[LINK]
    n, C, J = candidates.normal[row], candidates.covariance[row], seeding.known_jacobian[:, : 3 * known]
    normal, tangential = force_deviations(FORCE, FRICTION_RATIO)
    forces = tangential**2 * np.eye(3) + (normal**2 - tangential**2) * np.outer(n, n)
    by_force, moment_variance = _by_force(buffers, row), FORCE**2 * 0.5 * np.trace(C)
    S = np.tril(seeding.prior_covariance) + np.tril(seeding.prior_covariance, -1).T
    S += by_force @ forces @ by_force.T + moment_variance * A[:, 3:] @ A[:, 3:].T
    mean = J.T @ np.linalg.solve(S, seeding.innovation)
    covariance = np.eye(3 * known) - J.T @ np.linalg.solve(S, J)
    drawn = np.random.default_rng(7).multivariate_normal(mean, covariance, 200_000).reshape(-1, known, 3)
    across = RATIO_FACTOR * np.linalg.norm(drawn[:, :, 1:], axis=2) / np.abs(drawn[:, :, 0])
    density = (1.0 + across**2 / STUDENT_DOF) ** (-0.5 * (STUDENT_DOF + 2.0))
    return float(np.where(drawn[:, :, 0] < 0.0, density, 0.0).prod(axis=1).mean())


@pytest.mark.parametrize("known", [1, 2])
def test_weights_are_those_of_many_random_forces(known: int) -> None:
    buffers = _beside(known)
    expected = [_expected_weight(buffers, row, known) for row in range(PLACES)]
    assert max(expected) > 0.15 > 0.05 > min(expected)
    model, links = model_of(buffers, FRICTION_RATIO, FORCE), _links(buffers)
    found = [
        candidate_weight(links, model, known, buffers.candidates, row, buffers.seeding)
        for row in range(PLACES)
    ]
    np.testing.assert_allclose(found, expected, atol=0.02)


@pytest.mark.parametrize("known", [1, 2])
def test_candidates_are_sorted_and_their_probabilities_add_up_to_one(known: int) -> None:
    after = _weigh(_beside(known), known)
    assert sorted(after.order[:PLACES]) == list(range(PLACES))
    ranked = after.probability[after.order[:PLACES]]
    assert np.all(np.diff(ranked) <= 0.0)
    assert ranked.sum() == pytest.approx(1.0)


def test_nothing_changes_where_all_candidates_need_the_same_forces() -> None:
    buffers = _beside(1)
    candidates = buffers.candidates
    for numbers in (candidates.point, candidates.normal, candidates.force):
        numbers[:PLACES] = numbers[0]
    before = candidates.probability[:PLACES].copy()
    np.testing.assert_allclose(_weigh(buffers, 1).probability[:PLACES], before, rtol=1e-12)


@pytest.mark.parametrize("scale", [0.0, 1e-6, 1e6, 1e12])
def test_tiny_and_huge_readings_give_probabilities(scale: float) -> None:
    probability = _weigh(_beside(2, scale), 2).probability[:PLACES]
    assert np.all(probability > 0.0)
    assert probability.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("noise", [1e-4, 1e-7])
def test_exact_readings_leave_forces_their_variance(noise: float) -> None:
    """Rounding does not take it away: the factor has no NaN and no zero."""
    buffers = _beside(1)
    seeding, rng = buffers.seeding, np.random.default_rng(8)
    J = rng.standard_normal((ROWS, 3))
    seeding.known_jacobian[:, :3] = J
    seeding.innovation[:] = J @ (-1.0, 0.2, 0.1)
    seeding.factor[:] = noise**2 * np.eye(ROWS) + J @ J.T
    log_likelihood(ROWS, seeding)
    fill_known_forces(ROWS, 3, seeding)
    np.testing.assert_allclose(seeding.known_force[:3], (-1.0, 0.2, 0.1), atol=2e-2)
    assert np.all(np.diag(seeding.known_force_factor)[:3] > 0.0)


def test_the_ratio_of_the_priors_has_the_friction_ratio_of_students_t() -> None:
    """That of the prior has half the scale of the normal one's."""
    student = multivariate_t(shape=np.eye(2), df=STUDENT_DOF)
    for force in [(-1.0, 0.0, 0.0), (-1.0, 0.3, -0.4), (-0.2, 1.5, 0.1), (-3.0, 0.0, 0.7)]:
        ratio = RATIO_FACTOR * np.array(force[1:]) / force[0]
        expected = student.pdf(ratio) / student.pdf(np.zeros(2))
        assert prior_ratio(*force) == pytest.approx(expected, rel=1e-12)


def test_a_pull_is_impossible() -> None:
    assert prior_ratio(1.0, 0.0, 0.0) == 0.0
    assert prior_ratio(0.0, 1.0, 0.0) == 0.0


@pytest.mark.parametrize("robot", ["ur5e", pytest.param("ur10e", marks=pytest.mark.long)])
def test_an_answer_is_right_as_often_as_it_states(robot: str) -> None:
    """With much noise, explanations in which the known contact pulls would share the probability."""
    noise = COLUMNS[3]
    localizer = localizer_for(robot, noise, detail="coarse")
    trials = MeshTrials(localizer.scene, 1, shared("truth"), robot)
    verdicts = judge(localizer, noise, 1000, 2, SCENARIOS["forces free"], trials=trials)
    _, right, stated = np.array([v.answer for v in verdicts if v is not None]).T
    standard_error = math.sqrt(right.mean() * (1.0 - right.mean()) / len(right))
    assert abs(right.mean() - stated.mean()) < 2.0 * standard_error
