"""The list of places that the search for several contacts starts from."""

import numpy as np

from contactsense.several.scan import offer_seed

PRIMITIVES = np.array([0, 0, 0, 1], dtype=np.int64)
PLACE = np.array(
    [
        [0.00, 0.0, 0.1, 0.0, 0.0, 1.0],
        [0.02, 0.0, 0.1, 0.1, 0.0, 0.99],
        [0.00, 0.0, -0.1, 0.0, 0.0, -1.0],
        [0.00, 0.0, 0.3, 0.0, 0.0, 1.0],
    ]
)
"""Two neighbours on one side of a primitive, one on the other side, one on another primitive."""


def _offered(*offers: tuple[float, tuple[int, ...]], length: int = 4) -> list[tuple[int, ...]]:
    """What the list keeps, the best first."""
    count = len(offers[0][1])
    scores, seeds = np.full(length, -np.inf), np.zeros((length, 3), dtype=np.int64)
    for score, places in offers:
        offer_seed(PRIMITIVES, PLACE, count, score, *(*places, 0, 0)[:3], scores, seeds)
    assert (np.diff(scores[np.isfinite(scores)]) <= 0.0).all()
    return [tuple(int(place) for place in seed[:count]) for seed in seeds[np.isfinite(scores)]]


def test_of_neighbours_the_better_is_kept() -> None:
    assert _offered((1.0, (0,)), (2.0, (1,))) == [(1,)]
    assert _offered((2.0, (1,)), (1.0, (0,))) == [(1,)]


def test_both_sides_of_a_primitive_are_kept() -> None:
    assert _offered((1.0, (0,)), (2.0, (2,)), (3.0, (3,))) == [(3,), (2,), (0,)]


def test_pairs_that_differ_in_one_neighbour_are_one() -> None:
    assert _offered((1.0, (3, 0)), (2.0, (3, 1)), (0.5, (3, 2))) == [(3, 1), (3, 2)]


def test_a_full_list_drops_the_worst() -> None:
    assert _offered((1.0, (0,)), (2.0, (2,)), (3.0, (3,)), length=2) == [(3,), (2,)]
