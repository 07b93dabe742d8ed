"""The list of seeds of the search for several contacts."""

import numpy as np

from contactsense.multi_contact.seeding.seed_list import SeedList, find_slot, put_seed

PRIMITIVES = np.array([0, 0, 0, 1], dtype=np.int64)
POINT_NORMAL = np.array(
    [
        [0.00, 0.0, 0.1, 0.0, 0.0, 1.0],
        [0.02, 0.0, 0.1, 0.1, 0.0, 0.99],
        [0.00, 0.0, -0.1, 0.0, 0.0, -1.0],
        [0.00, 0.0, 0.3, 0.0, 0.0, 1.0],
    ]
)
"""Two neighbours on one side of a primitive, one on the other side, one on another primitive."""


def _inserted(*candidates: tuple[float, tuple[int, ...]], length: int = 4) -> list[tuple[int, ...]]:
    """Content of the list, the best first."""
    count = len(candidates[0][1])
    scores, seeds = np.full(length, -np.inf), np.zeros((length, 3), dtype=np.int64)
    found = SeedList(count, scores, seeds, PRIMITIVES, POINT_NORMAL)
    for score, samples in candidates:
        chosen = (*samples, 0, 0)[:3]
        slot = find_slot(found, score, chosen)
        if slot >= 0:
            put_seed(found, score, chosen, slot)
    assert (np.diff(scores[np.isfinite(scores)]) <= 0.0).all()
    return [tuple(int(sample) for sample in seed[:count]) for seed in seeds[np.isfinite(scores)]]


def test_the_better_of_two_neighbours_remains() -> None:
    assert _inserted((1.0, (0,)), (2.0, (1,))) == [(1,)]
    assert _inserted((2.0, (1,)), (1.0, (0,))) == [(1,)]


def test_both_sides_of_a_primitive_remain() -> None:
    assert _inserted((1.0, (0,)), (2.0, (2,)), (3.0, (3,))) == [(3,), (2,), (0,)]


def test_pairs_that_differ_in_one_neighbour_are_merged() -> None:
    assert _inserted((1.0, (3, 0)), (2.0, (3, 1)), (0.5, (3, 2))) == [(3, 1), (3, 2)]


def test_a_full_list_drops_the_worst() -> None:
    assert _inserted((1.0, (0,)), (2.0, (2,)), (3.0, (3,)), length=2) == [(3,), (2,)]
