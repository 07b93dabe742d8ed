"""Uncorrelated combinations of a wrench's components, against dense linear algebra."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contactsense.kinematics.decorrelation import decorrelate
from contactsense.kinematics.linalg.ldl import half_squared_norm

ORIGIN = np.array([0.3, -0.2, 0.5])


def about(origin: np.ndarray) -> np.ndarray:
    """Components about a point of a wrench about the base origin, shape (6, 6)."""
    x, y, z = origin
    move = np.eye(6)
    move[3:, :3] = -np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return move


def total_covariance(origin: np.ndarray, noise: tuple[float, float], error: np.ndarray) -> np.ndarray:
    """Covariance of the wrench, base axes, about the base origin."""
    back = np.linalg.inv(about(origin))
    return back @ np.diag(np.repeat(noise, 3)) @ back.T + error


def decorrelated(
    origin: np.ndarray, noise: tuple[float, float], error: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    rows, variances = np.full((6, 6), np.nan), np.full(6, np.nan)
    decorrelate(origin, noise, error, rows, variances)
    return rows, variances


@given(
    seed=st.integers(0, 2**32 - 1),
    rank=st.integers(0, 6),
    noise=st.tuples(st.floats(1e-4, 10.0), st.floats(1e-4, 10.0)),
)
def test_the_combinations_are_uncorrelated(seed: int, rank: int, noise: tuple[float, float]) -> None:
    chance = np.random.default_rng(seed)
    origin, root = chance.uniform(-1.0, 1.0, 3), chance.standard_normal((6, rank))
    rows, variances = decorrelated(origin, noise, root @ root.T)
    covariance = rows @ total_covariance(origin, noise, root @ root.T) @ rows.T
    scale = np.sqrt(np.outer(variances, variances))
    np.testing.assert_allclose(covariance / scale, np.eye(6), atol=1e-9)


def test_they_leave_the_energy_of_a_wrench_as_it_is() -> None:
    chance, noise = np.random.default_rng(1), (0.09, 4e-4)
    root, wrench = chance.standard_normal((6, 3)), chance.standard_normal(6)
    rows, variances = decorrelated(ORIGIN, noise, root @ root.T)
    expected = half_squared_norm(total_covariance(ORIGIN, noise, root @ root.T), wrench)
    assert 0.5 * np.sum((rows @ wrench) ** 2 / variances) == pytest.approx(expected, rel=1e-10)


def test_without_another_error_they_are_the_components_about_the_origin() -> None:
    rows, variances = decorrelated(ORIGIN, (0.09, 4e-4), np.zeros((6, 6)))
    np.testing.assert_array_equal(rows, about(ORIGIN))
    np.testing.assert_array_equal(variances, np.repeat((0.09, 4e-4), 3))


@pytest.mark.parametrize("size", [1e-12, 1e3, 1e6])
def test_one_error_however_large_hides_one_combination_only(size: float) -> None:
    """An error along one wrench, as that of a mass is: what it hides is one of six degrees of freedom."""
    direction = np.array([0.0, 0.0, -1.0, 0.2, 0.4, 0.0])
    rows, variances = decorrelated(ORIGIN, (0.09, 4e-4), size**2 * np.outer(direction, direction))
    noise = np.repeat((0.09, 4e-4), 3)
    assert (variances >= noise).all()
    energy = 0.5 * np.sum((rows @ (size * direction)) ** 2 / variances)
    assert energy <= 0.5 * (1.0 + 1e-6)
    side = np.array([1.0, 0.0, 0.0, 0.0, 0.5, 0.2])  # no moment about the origin
    assert 0.5 * np.sum((rows @ side) ** 2 / variances) == pytest.approx(0.5 / 0.09, rel=0.35)
