"""Farthest-point sampling: points spread evenly over a set, each with the members that are nearest to it.

T. F. Gonzalez, "Clustering to minimize the maximum intercluster distance", Theoretical Computer Science,
1985.
"""

import math

import numpy as np

from contactsense.robots.jit.kernel import kernel


@kernel
def farthest_point_sampling(
    features: np.ndarray, first: int, count: int, squared_distance: np.ndarray, owner: np.ndarray
) -> int:
    """Choose up to `count` members, each the farthest from those chosen before, and assign every member to
    the nearest of them, the earlier one if two are equally near.

    Args:
        features: Coordinates of the members, shape (N, k).
        first: Number of the member that is chosen first.
        count: Largest number of members to choose; fewer if there are fewer distinct members.
        squared_distance: Filled with the squared distance of each member to the chosen one, shape (N,).
        owner: Filled with the place of that one in the order of choice, shape (N,), int64.

    Returns:
        Number of members that were chosen.
    """
    members, dimensions = features.shape
    for j in range(members):
        squared_distance[j], owner[j] = math.inf, 0
    chosen = first
    for i in range(count):
        farthest, largest = 0, -1.0
        for j in range(members):
            sum_of_squares = 0.0
            for k in range(dimensions):
                difference = features[j, k] - features[chosen, k]
                sum_of_squares += difference * difference
            if sum_of_squares < squared_distance[j]:
                squared_distance[j], owner[j] = sum_of_squares, i
            if squared_distance[j] > largest:
                farthest, largest = j, squared_distance[j]
        if largest == 0.0:
            return i + 1
        chosen = farthest
    return count


@kernel
def farthest_points_of_groups(
    features: np.ndarray,
    start: np.ndarray,
    eccentricity: np.ndarray,
    count: int,
    squared_distance: np.ndarray,
    owner: np.ndarray,
    counts: np.ndarray,
) -> None:
    """`farthest_point_sampling` of each of G groups of members; the first that is chosen is the one with the
    largest eccentricity.

    Args:
        features: Coordinates of the members, sorted by group, shape (N, k).
        start: First member of each group, then the total number, shape (G + 1,).
        eccentricity: Of each member, shape (N,).
        count: Largest number of members to choose from a group.
        squared_distance, owner: Filled as by `farthest_point_sampling`, shape (N,).
        counts: Filled with the number of members that were chosen from each group, shape (G,), int64.
    """
    for g in range(counts.shape[0]):
        a, b = start[g], start[g + 1]
        first = a
        for j in range(a, b):
            if eccentricity[j] > eccentricity[first]:
                first = j
        counts[g] = farthest_point_sampling(
            features[a:b], first - a, count, squared_distance[a:b], owner[a:b]
        )
