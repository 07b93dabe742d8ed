"""Systems of equations with a Cholesky factor, against NumPy."""

import numpy as np
import pytest

from contactsense.kinematics.linalg.cholesky import cholesky, cholesky_solve, substitute_lower

SIZE, COLUMNS = 9, 4


@pytest.fixture
def matrix() -> np.ndarray:
    root = np.random.default_rng(1).standard_normal((SIZE, SIZE))
    return np.asarray(root @ root.T + 0.1 * np.eye(SIZE))


def test_the_factor_and_the_log_determinant_are_those_of_numpy(matrix: np.ndarray) -> None:
    L = matrix.copy()
    assert cholesky(L, SIZE) == pytest.approx(np.linalg.slogdet(matrix)[1])
    np.testing.assert_allclose(np.tril(L), np.linalg.cholesky(matrix), rtol=1e-9)


def test_a_matrix_that_is_not_positive_definite_has_an_infinite_determinant(matrix: np.ndarray) -> None:
    matrix[3, 3] = -1.0
    assert cholesky(matrix, SIZE) == np.inf


@pytest.mark.parametrize("size", [1, SIZE - 2, SIZE])
def test_systems_are_solved_in_place_of_the_first_rows_and_columns(matrix: np.ndarray, size: int) -> None:
    B = np.random.default_rng(2).standard_normal((SIZE, COLUMNS + 1))
    L = matrix.copy()
    cholesky(L, size)
    for solve, A in (
        (substitute_lower, np.linalg.cholesky(matrix[:size, :size])),
        (cholesky_solve, matrix[:size, :size]),
    ):
        X = B.copy()
        solve(L, size, X, COLUMNS)
        np.testing.assert_allclose(A @ X[:size, :COLUMNS], B[:size, :COLUMNS], atol=1e-10)
        np.testing.assert_array_equal(X[size:], B[size:])
        np.testing.assert_array_equal(X[:, COLUMNS:], B[:, COLUMNS:])
