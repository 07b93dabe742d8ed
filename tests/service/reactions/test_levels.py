import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contactsense.service.reactions.levels import exceedance

EYE = np.eye(3).tolist()
forces = st.floats(0.0, 500.0)


def test_a_force_at_the_level_is_above_it_with_one_half() -> None:
    assert exceedance([0.0, 30.0, 40.0], EYE, 50.0) == pytest.approx(0.5)


def test_against_samples_of_the_force() -> None:
    rng = np.random.default_rng(1)
    covariance = np.array([[4.0, 1.0, 0.0], [1.0, 9.0, 0.5], [0.0, 0.5, 1.0]])
    mean = np.array([40.0, 30.0, -10.0])
    drawn = np.linalg.norm(rng.multivariate_normal(mean, covariance, 200_000), axis=1)
    for level in (46.0, 50.0, 53.0, 56.0):
        assert exceedance(mean, covariance.tolist(), level) == pytest.approx(np.mean(drawn > level), abs=0.02)


@given(forces, forces, st.floats(0.1, 50.0), st.floats(1.0, 200.0))
def test_more_force_is_more_probable(a: float, b: float, sigma: float, level: float) -> None:
    low, high = sorted((a, b))
    covariance = (sigma**2 * np.eye(3)).tolist()
    assert exceedance([low, 0, 0], covariance, level) <= exceedance([high, 0, 0], covariance, level) + 1e-12


@pytest.mark.parametrize(
    ("force", "variance"), [(10.0, math.inf), (10.0, math.nan), (math.nan, 1.0), (math.inf, 1.0)]
)
def test_what_is_not_known_is_one_half(force: float, variance: float) -> None:
    assert exceedance([force, 0.0, 0.0], np.full((3, 3), variance).tolist(), 50.0) == 0.5


@pytest.mark.parametrize(("force", "expected"), [(51.0, 1.0), (49.0, 0.0), (0.0, 0.0)])
def test_without_noise(force: float, expected: float) -> None:
    assert exceedance([force, 0.0, 0.0], np.zeros((3, 3)).tolist(), 50.0) == expected


def test_without_a_force_every_direction_counts_alike() -> None:
    """The standard deviation is that of the mean variance: 2 N, which 4 N is twice of."""
    covariance = np.diag([1.0, 4.0, 7.0]).tolist()
    above_two_sigma = 0.5 * math.erfc(2.0 / math.sqrt(2.0))
    assert exceedance([0.0, 0.0, 0.0], covariance, 4.0) == pytest.approx(above_two_sigma)


@pytest.mark.parametrize("newtons", [0.5, 50.0])
def test_the_deviation_is_that_along_the_force_in_each_direction(newtons: float) -> None:
    """Also of a small force, and along z: 3 N there, 1 N along the others."""
    covariance = np.diag([1.0, 1.0, 9.0]).tolist()
    for force, sigma in (([0.0, 0.0, newtons], 3.0), ([newtons, 0.0, 0.0], 1.0)):
        above_one_sigma = 0.5 * math.erfc(1.0 / math.sqrt(2.0))
        assert exceedance(force, covariance, newtons + sigma) == pytest.approx(above_one_sigma)
