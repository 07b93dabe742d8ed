"""Sets of contacts that overlap are one; against the candidates of one contact and sums over the mixture."""

import numpy as np
import pytest

from contactsense import Scene
from contactsense.localization.candidates.mixture_reduction import SIGNIFICANT_DISTANCE, merge_overlapping
from contactsense.multi_contact.explanations.set_reduction import merge_with_answer
from contactsense.runtime.result_rows import COVARIANCE, LINK, POINT_BASE, PRIMITIVE, PROBABILITY, WIDTH
from contactsense.runtime.state import empty_state
from contactsense.scene_model.constants import build_constants

pytestmark = pytest.mark.slow  # its kernels compile for long


def _rows(
    links: list[list[int]], probabilities: list[float], points: list[list[list[float]]], deviation: float
) -> tuple[np.ndarray, np.ndarray]:
    """Rows and counts of sets: links and points of the contacts of each, and its probability."""
    counts = np.array([len(of_set) for of_set in links])
    rows = np.zeros((counts.sum(), WIDTH))
    rows[:, LINK] = np.concatenate(links)
    rows[:, PROBABILITY] = np.repeat(probabilities, counts)
    rows[:, POINT_BASE] = np.concatenate(points)
    rows[:, COVARIANCE] = deviation**2 * np.eye(3).ravel()
    return rows, counts


def test_pairs_on_the_same_links_and_places_are_one() -> None:
    links = [[2, 4], [2, 5], [2, 4], [2, 4], [2]]
    near, far = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]], [[0.0, 0.0, 0.0], [0.5, 0.1, 0.0]]
    moved = [[0.01, 0.0, 0.0], [0.5, 0.0, 0.02]]
    rows, counts = _rows(links, [0.4, 0.2, 0.15, 0.2, 0.05], [near, near, far, moved, near[:1]], 0.01)
    untouched = rows.copy()
    merged, left = merge_with_answer(rows, counts)
    np.testing.assert_array_equal(rows, untouched)
    assert left.tolist() == [2, 2, 2, 1]
    np.testing.assert_allclose(merged[[0, 2, 4, 6], PROBABILITY], [0.6, 0.2, 0.15, 0.05])
    np.testing.assert_array_equal(merged[:2, POINT_BASE], near)
    # Two thirds of 0.4 and one of 0.2: the square of each offset, a third of it.
    expected = np.stack([np.diag([1e-4 + 1e-4 / 3.0, 1e-4, 1e-4]), np.diag([1e-4, 1e-4, 1e-4 + 4e-4 / 3.0])])
    np.testing.assert_allclose(merged[:2, COVARIANCE].reshape(2, 3, 3), expected)


def test_one_place_that_differs_is_enough_for_another_explanation() -> None:
    near, distance = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]], 0.01 * np.sqrt(2.0 * SIGNIFICANT_DISTANCE)
    for factor, left in ((0.99, 1), (1.01, 2)):
        other = [near[0], [0.5, factor * distance, 0.0]]
        rows, counts = _rows([[2, 4], [2, 4]], [0.7, 0.3], [near, other], 0.01)
        assert len(merge_with_answer(rows, counts)[1]) == left


def test_the_distances_of_all_places_add_up() -> None:
    # Each place alone does not differ.
    near, distance = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]], 0.01 * np.sqrt(SIGNIFICANT_DISTANCE)
    for factor, left in ((0.99, 1), (1.01, 2)):
        other = [[0.0, 0.0, factor * distance], [0.5, factor * distance, 0.0]]
        rows, counts = _rows([[2, 4], [2, 4]], [0.7, 0.3], [near, other], 0.01)
        assert len(merge_with_answer(rows, counts)[1]) == left


def test_only_the_answer_absorbs_others() -> None:
    # Of two others that overlap, each keeps its own place: they are told apart from the answer.
    places = [[[0.1 * i, 0.0, 0.0]] for i in (0, 1, 2, 2)]
    rows, counts = _rows([[2], [2], [2], [2]], [0.4, 0.3, 0.2, 0.1], places, 0.005)
    merged, left = merge_with_answer(rows, counts)
    np.testing.assert_array_equal(merged, rows)
    np.testing.assert_array_equal(left, counts)


@pytest.mark.parametrize("seed", range(5))
def test_one_contact_is_merged_as_its_candidates_are(seed: int) -> None:
    constants, rng = build_constants(Scene(robot="ur5e")), np.random.default_rng(seed)
    candidates, count = empty_state(constants).candidates, 7
    primitive = rng.integers(0, 6, count)
    rows = np.zeros((count, WIDTH))
    rows[:, LINK], rows[:, PRIMITIVE] = constants.surfaces.link[primitive], primitive
    rows[:, PROBABILITY] = np.sort(rng.dirichlet(np.ones(count)))[::-1]
    rows[:, POINT_BASE] = 0.02 * rng.standard_normal((count, 3))
    roots = 0.01 * rng.standard_normal((count, 3, 3))
    rows[:, COVARIANCE] = (roots @ np.swapaxes(roots, 1, 2)).reshape(count, 9)
    candidates.order[:count] = np.arange(count)
    candidates.primitive[:count], candidates.probability[:count] = primitive, rows[:, PROBABILITY]
    candidates.point[:count] = rows[:, POINT_BASE]
    candidates.covariance[:count] = rows[:, COVARIANCE].reshape(count, 3, 3)

    merged, _ = merge_with_answer(rows, np.ones(count, dtype=np.int64))
    merge_overlapping(constants.surfaces, candidates, count)

    assert merged[0, PROBABILITY] == pytest.approx(candidates.probability[0])
    np.testing.assert_allclose(merged[0, COVARIANCE].reshape(3, 3), candidates.covariance[0])


def test_no_set_at_all() -> None:
    merged, counts = merge_with_answer(np.zeros((0, WIDTH)), np.zeros(0, dtype=np.int64))
    assert merged.shape == (0, WIDTH)
    assert len(counts) == 0
