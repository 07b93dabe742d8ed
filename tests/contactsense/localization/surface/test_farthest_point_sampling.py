"""Members are chosen and assigned as by a search over all of them."""

import numpy as np
import pytest

from contactsense.localization.surface.farthest_point_sampling import (
    farthest_point_sampling,
    farthest_points_of_groups,
)


def _sample(features: np.ndarray, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    squared_distance, owner = np.empty(len(features)), np.empty(len(features), dtype=np.int64)
    farthest_point_sampling(features, first, count, squared_distance, owner)
    return squared_distance, owner


@pytest.mark.parametrize("count", [1, 4, 60])
def test_each_is_farthest_from_those_before(count: int) -> None:
    features = np.random.default_rng(1).standard_normal((60, 6))
    squared_distance, owner = _sample(features, 7, count)
    chosen = [7]
    while len(chosen) < count:
        distance = np.linalg.norm(features[:, None] - features[chosen], axis=2).min(axis=1)
        chosen.append(int(np.argmax(distance)))
    all_distances = ((features[:, None] - features[chosen]) ** 2).sum(axis=2)
    np.testing.assert_array_equal(owner, all_distances.argmin(axis=1))
    np.testing.assert_allclose(squared_distance, all_distances.min(axis=1), rtol=1e-14)


def test_no_more_are_chosen_than_are_distinct() -> None:
    features = np.repeat([[0.0, 1.0], [3.0, 1.0]], 5, axis=0)
    squared_distance, owner = _sample(features, 0, 4)
    assert owner.tolist() == [0] * 5 + [1] * 5
    assert not squared_distance.any()


def test_groups_are_sampled_each_for_itself() -> None:
    """Also one with fewer distinct members than are to be chosen."""
    rng = np.random.default_rng(2)
    groups = [rng.standard_normal((size, 6)) for size in (9, 2, 30)] + [np.ones((5, 6))]
    eccentricity = [np.linalg.norm(group - group.mean(axis=0), axis=1) for group in groups]
    start = np.cumsum([0] + [len(group) for group in groups])
    squared_distance, owner = np.empty(start[-1]), np.empty(start[-1], dtype=np.int64)
    counts = np.empty(len(groups), dtype=np.int64)
    features = np.concatenate(groups)
    farthest_points_of_groups(
        features, start, np.concatenate(eccentricity), 4, squared_distance, owner, counts
    )
    assert counts.tolist() == [4, 2, 4, 1]
    for group, far, a, b in zip(groups, eccentricity, start[:-1], start[1:], strict=True):
        distance, alone = _sample(group, int(far.argmax()), 4)
        np.testing.assert_array_equal(owner[a:b], alone)
        np.testing.assert_array_equal(squared_distance[a:b], distance)
