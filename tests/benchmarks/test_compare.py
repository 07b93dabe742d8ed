"""Intervals of the comparison with other methods."""

import numpy as np
import pytest

from contactsense.benchmarks.compare import quantile


@pytest.mark.parametrize("probability", [0.5, 0.95])
def test_intervals_of_a_quantile_hold_it_in_19_of_20_cases(probability: float) -> None:
    rng = np.random.default_rng(2)
    held = []
    for _ in range(2000):
        value, low, high = quantile(rng.exponential(size=300), probability)
        assert low <= value <= high
        held.append(low <= -np.log(1.0 - probability) <= high)
    assert 0.94 < np.mean(held) < 0.975


def test_the_quantile_is_that_of_numpy_and_missing_answers_are_last() -> None:
    values = np.random.default_rng(3).exponential(size=201)
    assert quantile(values, 0.95)[0] == np.quantile(values, 0.95, method="higher")
    values[:15] = np.inf
    value, low, high = quantile(values, 0.95)
    assert np.isinf(value)
    assert np.isinf(high)
    assert low < np.inf
