"""The pool of joint optima and samples, against its formula."""

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.special import logsumexp

from contactsense.multi_contact.explanations.pooled_evidence import (
    SUM_WEIGHT,
    PooledSets,
    log_of_sum,
    pool_link_evidence,
)
from contactsense.multi_contact.memory.buffers import Explanations
from contactsense.robots.jit.flat_buffers import zeros

pytestmark = pytest.mark.slow  # its kernels compile for long

LINKS = 4
SURFACE_DEVIATION = 0.002
LINK = np.arange(LINKS, dtype=np.int64)
"""One primitive on each link."""

Optimum = tuple[float, tuple[int, int], float]
"""Log evidence, the two links, and the place along the second one [m]."""


def _explanations(optima: Sequence[Optimum]) -> Explanations:
    explanations = zeros(Explanations)
    for t, (score, links, place) in enumerate(optima):
        explanations.contacts[t] = 2
        explanations.score[t] = score
        explanations.primitive[t, :2] = links
        explanations.point[t, 1, 0] = place
        explanations.normal[t, :2] = (0.0, 0.0, 1.0)
        explanations.covariance[t, :2] = np.diag((4e-4, 1e-4, SURFACE_DEVIATION**2))
    return explanations


def _evidence(**pairs: float) -> np.ndarray:
    """Log evidence of pairs of links; the keyword `l31` is that of the links 3 and 1."""
    evidence = np.full((LINKS, LINKS), -np.inf)
    for name, value in pairs.items():
        evidence[int(name[1]), int(name[2])] = value
    return evidence


def _pooled(optima: Sequence[Optimum], evidence: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Log evidence of each optimum after pooling, and that of the pairs of links without one."""
    explanations, evidence = _explanations(optima), evidence.copy()
    sets = PooledSets(explanations, 0, len(optima), 0, 2)
    pool_link_evidence(LINK, sets, evidence, SURFACE_DEVIATION)
    return explanations.score[: len(optima)].copy(), evidence


def test_the_pool_is_the_weighted_geometric_mean() -> None:
    optima = [(3.0, (3, 1), 0.0), (2.0, (1, 3), 0.2), (-8.0, (2, 1), 0.0)]
    samples = np.array([-5.0 - np.log(2.0), -5.0 - np.log(2.0), -4.0])
    own = np.array([score for score, _, _ in optima])
    expected = SUM_WEIGHT * samples + (1.0 - SUM_WEIGHT) * own
    expected += logsumexp(own) - logsumexp(expected)
    np.testing.assert_allclose(_pooled(optima, _evidence(l31=-5.0, l21=-4.0))[0], expected, rtol=1e-12)


def test_links_on_which_nothing_fits_lose_against_an_exact_fit() -> None:
    score, _ = _pooled([(0.0, (3, 1), 0.0), (-15.0, (2, 1), 0.0)], _evidence(l31=0.0, l21=3.0))
    assert score[0] > score[1] + 3.0


def test_what_fits_equally_well_is_ranked_by_the_samples() -> None:
    score, _ = _pooled([(0.0, (3, 1), 0.0), (0.0, (2, 1), 0.0)], _evidence(l31=0.0, l21=3.0))
    assert score[1] - score[0] == pytest.approx(3.0 * SUM_WEIGHT)


def test_seeds_that_end_in_one_optimum_count_once() -> None:
    evidence = _evidence(l31=0.0, l21=1.0, l20=-1.0)
    once, unlisted = _pooled([(2.0, (3, 1), 0.0), (1.0, (2, 1), 0.0)], evidence)
    often, same = _pooled([(2.0, (3, 1), 0.0), (1.99, (1, 3), 0.0), (1.0, (2, 1), 0.0)], evidence)
    np.testing.assert_allclose(often[[0, 2]], once, rtol=1e-12)
    assert often[1] == -np.inf
    np.testing.assert_allclose(same, unlisted, rtol=1e-12)


@pytest.mark.parametrize(("deviations", "is_one"), [(0.25, True), (0.4, False)])
def test_places_far_closer_than_they_are_certain_are_one(deviations: float, is_one: bool) -> None:
    deviation = np.sqrt(np.trace(_explanations([(0.0, (3, 1), 0.0)]).covariance[0, 1]))
    optima = [(2.0, (3, 1), 0.0), (1.9, (3, 1), deviations * deviation), (1.0, (2, 1), 0.0)]
    score, _ = _pooled(optima, _evidence(l31=0.0, l21=1.0))
    assert (score[1] == -np.inf) == is_one


def test_links_without_an_explanation_keep_their_share_of_the_samples() -> None:
    evidence = _evidence(l31=0.0, l20=np.log(0.25), l11=np.log(0.125))
    score, unlisted = _pooled([(2.0, (3, 1), 0.0)], evidence)
    # Those of the explanation are not among them.
    np.testing.assert_allclose(
        unlisted - score[0], _evidence(l20=np.log(0.25), l11=np.log(0.125)), rtol=1e-12
    )


def test_the_sum_of_all_evidence_is_that_of_links_and_explanations() -> None:
    evidence, score = _evidence(l31=-700.0, l20=-701.0), np.array([-702.0, -np.inf, 5.0])
    assert log_of_sum(evidence, score, 2) == pytest.approx(logsumexp([-700.0, -701.0, -702.0]))
    assert log_of_sum(evidence, score, 3) == pytest.approx(5.0)
    assert log_of_sum(_evidence(), score[1:2], 1) == -np.inf


def test_one_further_contact_is_pooled_by_its_link_alone() -> None:
    optima = [(1.0, (0, 3), 0.0), (0.5, (0, 3), 0.2), (2.0, (0, 2), 0.0)]
    explanations = _explanations(optima)
    # The first contact is known: its link is the same in all.
    evidence = _evidence(l33=0.0, l22=-1.0, l11=-2.0)
    pool_link_evidence(LINK, PooledSets(explanations, 0, 3, 1, 1), evidence, SURFACE_DEVIATION)
    own, shares = np.array([1.0, 0.5, 2.0]), np.array([-np.log(2.0), -np.log(2.0), -1.0])
    expected = SUM_WEIGHT * shares + (1.0 - SUM_WEIGHT) * own
    expected += logsumexp(own) - logsumexp(expected)
    np.testing.assert_allclose(explanations.score[:3], expected, rtol=1e-12)
    listed = logsumexp([0.0, -1.0])
    assert evidence[1, 1] == pytest.approx(logsumexp(own) - 2.0 - listed)
    assert log_of_sum(evidence, explanations.score, 0) == evidence[1, 1]
