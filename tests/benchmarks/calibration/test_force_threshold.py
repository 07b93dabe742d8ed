"""The smallest detected force is that of touches whose thresholds are known."""

import math

import numpy as np
import pytest

from contactsense.benchmarks.calibration.force_threshold import force_threshold


def test_it_is_the_geometric_mean_of_thresholds_that_differ() -> None:
    rng = np.random.default_rng(3)
    needed = np.exp(rng.normal(math.log(20.0), 0.5, 20_000))
    forces = np.exp(rng.uniform(math.log(2.0), math.log(200.0), len(needed)))
    mean, low, high = force_threshold(int((forces >= needed).sum()), len(forces), 2.0, 200.0)
    assert low < 20.0 < high
    assert mean == pytest.approx(20.0, rel=0.05)


def test_one_that_detects_nothing_or_everything_is_at_an_end_of_the_range() -> None:
    assert force_threshold(0, 40, 5.0, 150.0).mean == pytest.approx(150.0)
    everything = force_threshold(40, 40, 5.0, 150.0)
    assert everything.mean == pytest.approx(5.0)
    assert everything.low <= everything.mean < everything.high
    assert math.isnan(force_threshold(0, 0, 5.0, 150.0).mean)
