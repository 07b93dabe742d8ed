"""Places of a further contact: the optimum mixed with the candidate at which the joint search started."""

import numpy as np

from contactsense.localization.candidates.candidate_buffers import Candidates
from contactsense.multi_contact.explanations.stored_explanations import mix_with_candidate
from contactsense.multi_contact.memory.buffers import Explanations
from contactsense.robots.jit.flat_buffers import zeros

ROW, CONTACT, EXPLANATION = 2, 1, 3


def _random_place(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A place [m] and a root of its covariance [m]."""
    return rng.uniform(-1.0, 1.0, 3), 0.01 * rng.standard_normal((3, 3))


def _sigma_points(place: np.ndarray, root: np.ndarray) -> np.ndarray:
    """Six points, shape (6, 3), with the mean and the covariance of a normal distribution."""
    return np.asarray(np.concatenate([place + np.sqrt(3.0) * sign * root.T for sign in (-1.0, 1.0)]))


def _mixed(optimum: tuple[np.ndarray, np.ndarray], candidate: tuple[np.ndarray, np.ndarray]) -> Explanations:
    explanations = zeros(Explanations)
    candidates = zeros(Candidates, candidates=ROW + 1, primitives=1)
    explanations.point[EXPLANATION, CONTACT] = optimum[0]
    explanations.covariance[EXPLANATION, CONTACT] = optimum[1] @ optimum[1].T
    candidates.point[ROW], candidates.covariance[ROW] = candidate[0], candidate[1] @ candidate[1].T
    candidates.probability[ROW] = 0.4
    mix_with_candidate(candidates, ROW, CONTACT, explanations, EXPLANATION)
    return explanations


def test_the_covariance_is_that_of_both_about_the_optimum() -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        optimum, candidate = _random_place(rng), _random_place(rng)
        away = np.concatenate([_sigma_points(*optimum), _sigma_points(*candidate)]) - optimum[0]
        mixed = _mixed(optimum, candidate)
        np.testing.assert_allclose(
            mixed.covariance[EXPLANATION, CONTACT], away.T @ away / len(away), rtol=1e-9, atol=1e-15
        )
        np.testing.assert_array_equal(mixed.point[EXPLANATION, CONTACT], optimum[0])


def test_two_that_agree_stay_as_they_are() -> None:
    place, root = _random_place(np.random.default_rng(2))
    mixed = _mixed((place, root), (place, root))
    np.testing.assert_allclose(mixed.covariance[EXPLANATION, CONTACT], root @ root.T, rtol=1e-12)


def test_the_explanation_is_as_probable_as_the_candidate() -> None:
    rng = np.random.default_rng(3)
    assert _mixed(_random_place(rng), _random_place(rng)).probability[EXPLANATION] == 0.4
