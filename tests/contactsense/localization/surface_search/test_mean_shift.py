"""Mean shift: against the gradient of the density that its kernel estimates."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contactsense.localization.surface_search.mean_shift import BANDWIDTH, mean_shift


def density(places: np.ndarray, point: np.ndarray) -> float:
    squared = ((places[:3].T - point) ** 2).sum(axis=1)
    return float(places[3] @ np.exp(-0.5 * squared / BANDWIDTH**2))


def places_of(points: np.ndarray, weight: float | np.ndarray = 1.0) -> np.ndarray:
    return np.vstack((points.T, np.broadcast_to(weight, len(points))))


@settings(max_examples=200)
@given(st.integers(0, 2**32 - 1), st.floats(0.01, 0.2))
def test_it_never_ends_where_the_density_is_lower(seed: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    places = places_of(size * rng.standard_normal((40, 3)), rng.random(40) ** 3)
    start = places[:3] @ places[3] / places[3].sum()
    end = np.array(mean_shift(places, tuple(start)))
    assert density(places, end) >= density(places, start) * (1.0 - 1e-6)


def test_it_ends_at_the_top_of_a_normal_density() -> None:
    rng = np.random.default_rng(1)
    points = 0.02 * rng.standard_normal((4000, 3)) + [0.3, -0.1, 0.2]
    end = mean_shift(places_of(points), (0.33, -0.1, 0.2))
    assert end == pytest.approx(points.mean(axis=0), abs=2e-3)


def test_from_between_two_lumps_it_goes_to_the_heavier_one() -> None:
    rng = np.random.default_rng(2)
    lump, apart = 0.01 * rng.standard_normal((200, 3)), np.array([0.05, 0.0, 0.0])
    weight = np.repeat([2.0, 1.0], 200)
    places = places_of(np.vstack((lump + apart, lump - apart)), weight)
    x, y, z = mean_shift(places, tuple(places[:3] @ weight / weight.sum()))
    assert (x, y, z) == pytest.approx((0.05, 0.0, 0.0), abs=0.01)


def test_from_inside_of_an_arc_it_goes_to_the_arc() -> None:
    angle = np.linspace(-2.0, 2.0, 60)
    arc = 0.1 * np.column_stack((np.cos(angle), np.sin(angle), 0.0 * angle))
    places = places_of(arc, np.exp(-(angle**2)))
    mean = places[:3] @ places[3] / places[3].sum()
    assert mean[0] < 0.08
    x, y, z = mean_shift(places, tuple(mean))
    assert np.hypot(x, y) == pytest.approx(0.1, abs=0.01)
    assert z == 0.0


def test_a_start_far_from_all_places_is_kept() -> None:
    assert mean_shift(places_of(np.zeros((3, 3)), 0.0), (1.0, 2.0, 3.0)) == (1.0, 2.0, 3.0)
    assert mean_shift(np.zeros((4, 0)), (1.0, 2.0, 3.0)) == (1.0, 2.0, 3.0)
