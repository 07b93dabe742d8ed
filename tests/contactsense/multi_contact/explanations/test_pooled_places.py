"""Covariances of the places in the pool of joint optima and sums over the surface."""

import numpy as np
import pytest

from contactsense.multi_contact.explanations.pooled_evidence import SUM_WEIGHT, PooledSets
from contactsense.multi_contact.explanations.pooled_places import (
    PLACE_WEIGHT,
    pool_covariance,
    pool_places,
    widen_places,
)
from contactsense.multi_contact.likelihood.pair_places import fill_place_covariance, fill_place_likelihood
from contactsense.multi_contact.memory.buffers import Explanations, MultiContactBuffers
from contactsense.multi_contact.seeding.seed_search import find_seeds
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.robots.vectors import tangents
from tests.contactsense.multi_contact.random_measurement import model_of, random_measurement

pytestmark = pytest.mark.slow  # its kernels compile for long

SURFACE_DEVIATION = 0.002
ALONG_NORMAL = SURFACE_DEVIATION**2
OPTIMUM = np.diag((4e-4, 1e-4, ALONG_NORMAL))


def _explanations() -> Explanations:
    """One explanation by two contacts with the covariance `OPTIMUM`."""
    explanations = zeros(Explanations)
    explanations.contacts[0] = 2
    explanations.normal[0, :2] = (0.0, 0.0, 1.0)
    explanations.covariance[0, :2] = OPTIMUM
    return explanations


def _random_covariance(rng: np.random.Generator, size: float) -> np.ndarray:
    root = size * rng.standard_normal((3, 3))
    return np.asarray(root @ root.T)


def test_a_region_grows_along_the_surface_only() -> None:
    explanations = _explanations()
    widen_places(PooledSets(explanations, 0, 1, 0, 2), SURFACE_DEVIATION)
    grown = 1.0 / (1.0 - SUM_WEIGHT)
    expected = np.diag((4e-4 * grown, 1e-4 * grown, ALONG_NORMAL))
    np.testing.assert_allclose(explanations.covariance[0, :2], [expected, expected], atol=1e-15)


def test_a_known_place_stays_as_it_is() -> None:
    explanations = _explanations()
    widen_places(PooledSets(explanations, 0, 1, 1, 1), SURFACE_DEVIATION)
    np.testing.assert_array_equal(explanations.covariance[0, 0], OPTIMUM)
    assert explanations.covariance[0, 1, 0, 0] == pytest.approx(4e-4 / (1.0 - SUM_WEIGHT))


def test_a_covariance_on_another_side_of_an_edge_stays_one() -> None:
    explanations = _explanations()
    normal = np.array([0.0, 0.6, 0.8])
    explanations.normal[0, :2] = normal
    widen_places(PooledSets(explanations, 0, 1, 0, 2), SURFACE_DEVIATION)
    for covariance in explanations.covariance[0, :2]:
        assert np.linalg.eigvalsh(covariance).min() > 0.0
        assert normal @ covariance @ normal == pytest.approx(ALONG_NORMAL)


@pytest.mark.parametrize("size", [0.002, 0.05, 1.0])
def test_the_pool_of_two_normal_distributions_is_the_weighted_sum_of_their_information(size: float) -> None:
    rng = np.random.default_rng(2)
    for _ in range(5):
        n = rng.standard_normal(3)
        n /= np.linalg.norm(n)
        T = np.array(tangents(tuple(n.tolist()))).T
        optimum, of_sum = _random_covariance(rng, size), _random_covariance(rng, 0.05)
        found = optimum.copy()
        pool_covariance(found, of_sum, n, SURFACE_DEVIATION)
        information = (1.0 - PLACE_WEIGHT) * np.linalg.inv(T.T @ optimum @ T)
        information += PLACE_WEIGHT * np.linalg.inv(T.T @ of_sum @ T)
        expected = T @ np.linalg.inv(information) @ T.T + ALONG_NORMAL * np.outer(n, n)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())


def test_a_place_that_the_measurement_gives_exactly_stays_exact() -> None:
    covariance = np.zeros((3, 3))
    pool_covariance(covariance, 1e-3 * np.eye(3), np.array([0.0, 0.0, 1.0]), SURFACE_DEVIATION)
    np.testing.assert_allclose(covariance, np.diag((0.0, 0.0, ALONG_NORMAL)), atol=1e-18)


def _two_contacts(links: tuple[int, int]) -> tuple[MultiContactBuffers, np.ndarray, np.ndarray]:
    """A random measurement with an explanation by two contacts at samples of these links; the link of each
    primitive, and the samples."""
    buffers, _, _ = random_measurement(2.0)
    seed_samples, explanations = buffers.seed_samples, buffers.explanations
    find_seeds(model_of(buffers, 0.25, 15.0), 2, buffers.seeding)
    link = np.zeros(int(seed_samples.primitive.max()) + 1, dtype=np.int64)
    link[seed_samples.primitive] = seed_samples.link
    samples = np.array([np.flatnonzero(seed_samples.link == k)[3] for k in links])
    explanations.primitive[0, :2] = seed_samples.primitive[samples]
    explanations.point[0, :2] = buffers.seeding.point_normal[samples, :3]
    explanations.normal[0, :2] = buffers.seeding.point_normal[samples, 3:]
    explanations.covariance[0, :2] = 1e-2 * np.eye(3)
    explanations.score[0] = buffers.seeding.pair_evidence.max()
    return buffers, link, samples


@pytest.mark.parametrize("links", [(4, 1), (1, 4)])
def test_places_are_pooled_with_the_sum_about_them(links: tuple[int, int]) -> None:
    buffers, link, samples = _two_contacts(links)
    seed_samples, seeding, explanations = buffers.seed_samples, buffers.seeding, buffers.explanations
    pool_places(link, seed_samples, SURFACE_DEVIATION, seeding, PooledSets(explanations, 0, 1, 0, 2))
    fill_place_likelihood(seed_samples, 4, 1, (0, 0), seeding)
    for i, (of, sample) in enumerate(zip(links, samples, strict=True)):
        place = seeding.point_normal[sample]
        of_sum, expected = np.zeros((3, 3)), 1e-2 * np.eye(3)
        fill_place_covariance(
            seed_samples, of, 0 if of == 4 else 1, place, SURFACE_DEVIATION, seeding, of_sum
        )
        pool_covariance(expected, of_sum, place[3:], SURFACE_DEVIATION)
        np.testing.assert_allclose(explanations.covariance[0, i], expected, rtol=1e-12, atol=1e-15)


def test_two_contacts_on_one_link_are_widened_only() -> None:
    buffers, link, samples = _two_contacts((3, 3))
    sets = PooledSets(buffers.explanations, 0, 1, 0, 2)
    pool_places(link, buffers.seed_samples, SURFACE_DEVIATION, buffers.seeding, sets)
    n = buffers.seeding.point_normal[samples[0], 3:]
    expected = 1e-2 / (1.0 - SUM_WEIGHT) * (np.eye(3) - np.outer(n, n)) + ALONG_NORMAL * np.outer(n, n)
    np.testing.assert_allclose(buffers.explanations.covariance[0, 0], expected, rtol=1e-9, atol=1e-12)
