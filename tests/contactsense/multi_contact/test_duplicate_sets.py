"""Explanations with the same contacts are duplicates; those with other contacts are not."""

import itertools
from collections.abc import Sequence

import numpy as np
import pytest

from contactsense.multi_contact.explanations.ranked_sets import order_distinct, share_evidence
from contactsense.multi_contact.memory.buffers import Explanations
from contactsense.robots.jit.flat_buffers import zeros

pytestmark = pytest.mark.slow  # its kernels compile for long

NEAR = 0.01
"""Places within this distance are one [m]."""
A, B, C = 0.0, 0.1, 0.2
"""Places far from each other, along a line [m]."""
LINK = np.arange(2, dtype=np.int64)


def kept(*sets: Sequence[float], link: Sequence[Sequence[int]] | None = None) -> list[int]:
    """Which of these sets of places remain, best first."""
    explanations = zeros(Explanations)
    for i, places in enumerate(sets):
        explanations.contacts[i] = len(places)
        explanations.score[i] = -0.1 * i
        explanations.point[i, : len(places), 0] = places
        if link is not None:
            explanations.primitive[i, : len(places)] = link[i]
    count = order_distinct(LINK, explanations, 0, len(sets), NEAR, 100.0)
    return explanations.order[:count].tolist()


def test_two_contacts_at_one_place_are_not_one_there_and_one_elsewhere() -> None:
    assert kept((A, B), (A, A + 0.5 * NEAR)) == [0, 1]
    assert kept((A, A + 0.5 * NEAR), (A, B)) == [0, 1]
    assert kept((A, B, C), (A, B, B + 0.5 * NEAR)) == [0, 1]


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_the_same_places_in_any_order_are_a_duplicate(order: tuple[int, ...]) -> None:
    places = np.array([A, B, C])
    assert kept(places, places[list(order)] + 0.5 * NEAR) == [0]


def test_a_place_near_two_takes_the_one_that_the_other_does_not_need() -> None:
    """The first contact of the second set is near both of the first, the second one near one only."""
    first, second = (A, A + 0.9 * NEAR), (A + 0.6 * NEAR, A - 0.8 * NEAR)
    assert kept(first, second) == kept(first, second[::-1]) == kept(first[::-1], second) == [0]


def test_the_same_places_on_other_links_are_no_duplicate() -> None:
    assert kept((A, B), (A, B), link=((0, 1), (0, 0))) == [0, 1]
    assert kept((A, B), (A, B), link=((0, 1), (0, 1))) == [0]


def test_an_optimum_has_the_probability_of_all_starts_that_have_ended_there() -> None:
    """Its evidence counts once, and the sum over the optima remains."""
    explanations = zeros(Explanations)
    explanations.contacts[:4] = 1
    explanations.point[:4, 0, 0] = A, A + 0.5 * NEAR, B, A - 0.5 * NEAR
    explanations.probability[:4] = 0.2, 0.1, 0.4, 0.3
    explanations.score[:4] = -1.0, -1.1, -3.0, -1.2
    share_evidence(LINK, explanations, 0, 4, NEAR)
    total = np.logaddexp(-1.0, -3.0)
    expected = [total + np.log(0.6), -np.inf, total + np.log(0.4), -np.inf]
    np.testing.assert_allclose(explanations.score[:4], expected)
