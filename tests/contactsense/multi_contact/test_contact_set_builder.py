"""The probability of a contact is that of all sets that contain it."""

import numpy as np

from contactsense.multi_contact.contact_set_builder import SAME_POINT_DISTANCE, state_marginal_probabilities
from contactsense.runtime.result_rows import LINK, POINT_BASE, PROBABILITY, WIDTH


def test_each_set_with_the_contact_counts_once() -> None:
    rng = np.random.default_rng(0)
    counts = [1, 2, 3, 2, 2]
    set_of, probability = np.repeat(np.arange(len(counts)), counts), np.array([0.3, 0.25, 0.2, 0.15, 0.1])
    rows = np.zeros((sum(counts), WIDTH))
    rows[:, LINK] = rng.integers(0, 2, len(rows))
    # In a cube so small that about half of the pairs are one place.
    rows[:, POINT_BASE] = rng.uniform(0.0, 1.5 * SAME_POINT_DISTANCE, (len(rows), 3))
    expected = []
    for row in rows:
        near = np.linalg.norm(rows[:, POINT_BASE] - row[POINT_BASE], axis=1) < SAME_POINT_DISTANCE
        sets = set(set_of[near & (rows[:, LINK] == row[LINK])].tolist())
        expected.append(sum(probability[k] for k in sets))
    assert len(set(np.round(expected, 9))) > 3
    state_marginal_probabilities(rows, set_of, probability)
    np.testing.assert_allclose(rows[:, PROBABILITY], expected)
