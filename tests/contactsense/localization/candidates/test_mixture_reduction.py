"""Candidates that overlap are one, with the moments of their mixture; against sums over the mixture."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from contactsense import JointTorqueSensor, Localizer, Scene, WrenchSensor
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import empty_motion
from contactsense.localization.candidates.candidate_buffers import Candidates
from contactsense.localization.candidates.mixture_reduction import SIGNIFICANT_DISTANCE, merge_overlapping
from contactsense.readings import forward_model
from contactsense.runtime.state import empty_state
from contactsense.scene_model.constants import build_constants

CONSTANTS = build_constants(Scene(robot="ur5e"))
LINK = CONSTANTS.surfaces.link


def _candidates(
    primitives: list[int], probabilities: list[float], points: np.ndarray, covariances: np.ndarray
) -> Candidates:
    """Candidates in rows 0, 1, ..., in that order."""
    candidates = empty_state(CONSTANTS).candidates
    count = len(primitives)
    candidates.order[:count] = np.arange(count)
    candidates.primitive[:count] = primitives
    candidates.probability[:count] = probabilities
    candidates.point[:count], candidates.covariance[:count] = points, covariances
    return candidates


def _random(rng: np.random.Generator, count: int) -> Candidates:
    primitives = rng.integers(0, 6, count).tolist()
    probabilities = np.sort(rng.dirichlet(np.ones(count)))[::-1].tolist()
    roots = 10.0 ** rng.uniform(-5, -1.5, (count, 1, 1)) * rng.standard_normal((count, 3, 3))
    return _candidates(
        primitives, probabilities, 0.03 * rng.standard_normal((count, 3)), roots @ np.swapaxes(roots, 1, 2)
    )


def _squared_distance(candidates: Candidates, a: int, b: int) -> float:
    offset = candidates.point[b] - candidates.point[a]
    return float(offset @ np.linalg.solve(candidates.covariance[a] + candidates.covariance[b], offset))


def test_the_threshold_is_99_percent_of_two_coordinates() -> None:
    assert pytest.approx(chi2.ppf(0.99, 2), abs=5e-4) == SIGNIFICANT_DISTANCE


@pytest.mark.slow
@settings(max_examples=200)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 8))
def test_what_remains_is_the_mixture_with_its_moments(seed: int, count: int) -> None:
    before = _random(np.random.default_rng(seed), count)
    after = Candidates(*(np.copy(array) for array in before))
    remaining = list(range(count))
    expected = {}
    while remaining:  # brute force: the most probable one left absorbs those of its link near to it
        first = remaining[0]
        same = [
            k
            for k in remaining
            if k == first
            or (
                LINK[before.primitive[k]] == LINK[before.primitive[first]]
                and _squared_distance(before, first, k) < SIGNIFICANT_DISTANCE
            )
        ]
        weight = before.probability[same]
        offset = before.point[same] - before.point[first]
        moments = before.covariance[same] + offset[:, :, None] * offset[:, None, :]
        expected[first] = weight.sum(), np.einsum("k,kij->ij", weight, moments) / weight.sum()
        remaining = [k for k in remaining if k not in same]

    left = merge_overlapping(CONSTANTS.surfaces, after, count)

    assert set(after.order[:left].tolist()) == set(expected)
    assert (np.diff(after.probability[after.order[:left]]) <= 0.0).all()
    for row, (probability, covariance) in expected.items():
        assert after.probability[row] == pytest.approx(probability)
        np.testing.assert_allclose(after.covariance[row], covariance, rtol=1e-9, atol=1e-15)
    np.testing.assert_array_equal(after.point[:count], before.point[:count])


def test_the_order_is_that_of_the_sums() -> None:
    # Two halves of one place together are more probable than the candidate between them.
    near, exact = 1e-3 * np.arange(3)[:, None] * np.eye(3)[0], 1e-4 * np.eye(3)
    first, last = int(np.flatnonzero(LINK == 1)[0]), int(np.flatnonzero(LINK == 3)[0])
    candidates = _candidates([first, last, first], [0.3, 0.45, 0.25], near, np.stack([exact] * 3))
    candidates.order[:3] = 1, 0, 2
    assert merge_overlapping(CONSTANTS.surfaces, candidates, 3) == 2
    assert candidates.order[:2].tolist() == [0, 1]
    assert candidates.probability[0] == pytest.approx(0.55)


@pytest.mark.parametrize("broken", [np.nan, np.inf])
def test_covariances_that_are_not_finite_are_not_merged(broken: float) -> None:
    covariances = np.stack([np.full((3, 3), broken), 1e-6 * np.eye(3)])
    candidates = _candidates([3, 3], [0.6, 0.4], np.zeros((2, 3)), covariances)
    assert merge_overlapping(CONSTANTS.surfaces, candidates, 2) == 2


def test_exact_places_differ() -> None:
    points = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1e-4]])
    candidates = _candidates([3, 3], [0.6, 0.4], points, np.zeros((2, 3, 3)))
    assert merge_overlapping(CONSTANTS.surfaces, candidates, 2) == 2


@pytest.mark.parametrize(
    ("link", "point", "normal"),
    [
        ("upper_arm", (-0.4048, 0.0549, 0.1790), (0.325, 0.946, 0.0)),
        ("upper_arm", (-0.0193, 0.0554, 0.1202), (0.0, 0.953, -0.301)),
        ("forearm", (-0.3826, 0.0364, 0.0208), (0.236, 0.972, 0.0)),
    ],
)
def test_a_place_where_two_primitives_meet_is_one_explanation(
    link: str, point: tuple[float, float, float], normal: tuple[float, float, float]
) -> None:
    scene = Scene(
        robot="ur5e",
        base_wrench=WrenchSensor(force_noise=0.25, moment_noise=0.05),
        joint_torque=JointTorqueSensor(noise=1.0),
    )
    q, motion = np.array([0.3, -1.2, 1.5, -1.9, -1.4, 0.5]), empty_motion(6)
    forward_kinematics(CONSTANTS.model, q, motion)
    number = scene.link_names.index(link)
    R, o = motion.rotation[number], motion.origin[number]
    readings = forward_model(scene, q, link, np.array(point), -30.0 * R @ normal, external=True)
    found = Localizer(scene).locate(q, base_wrench=readings.base_wrench, joint_torque=readings.joint_torque)
    assert found.status == "contact"
    assert [contact.link for contact in found.contacts] == [link]
    (contact,) = found.contacts
    error = contact.point_base - (R @ point + o)
    assert error @ np.linalg.solve(contact.covariance, error) < SIGNIFICANT_DISTANCE
