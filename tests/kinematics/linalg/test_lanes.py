"""Eight systems of equations at a time against NumPy's, and the operations they are made of against their
definitions in Python."""

import numpy as np
import pytest

from contactsense.kinematics.linalg import lanes
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.jit.lanes import LANES

ROOM = 24
"""Unknowns that the arrays have room for."""


def _systems(size: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positive definite matrices, and the same as lanes; lanes of a right-hand side."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((LANES, size, size))
    matrices = root @ root.transpose(0, 2, 1) + 0.1 * np.eye(size)
    H = np.full((ROOM, ROOM * LANES), np.nan)
    H[:size, : size * LANES] = matrices.transpose(1, 2, 0).reshape(size, size * LANES)
    return matrices, H, rng.standard_normal(ROOM * LANES)


@pytest.mark.parametrize("size", [1, 3, 7, 14, 21])
def test_solutions_and_pivots_agree_with_numpy(size: int) -> None:
    matrices, H, g = _systems(size, size)
    right = g.reshape(ROOM, LANES)[:size].T.copy()
    pivots, inverse = np.zeros(ROOM * LANES), np.zeros(ROOM * LANES)
    lanes.cholesky_in_lanes(H, size, pivots, inverse)
    lanes.substitute(H, size, inverse, g)
    lanes.substitute_back(H, size, inverse, g)
    expected = np.linalg.solve(matrices, right[..., None])[..., 0]
    np.testing.assert_allclose(g.reshape(ROOM, LANES)[:size].T, expected, rtol=1e-8, atol=1e-10)
    log_det = np.log(pivots.reshape(ROOM, LANES)[:size]).sum(axis=0)
    np.testing.assert_allclose(log_det, np.linalg.slogdet(matrices)[1], rtol=1e-9, atol=1e-9)


def test_a_matrix_that_is_not_positive_definite_harms_no_other_lane() -> None:
    matrices, H, g = _systems(7, 0)
    H[3, 3 * LANES + 2] = -1.0
    right = g.reshape(ROOM, LANES)[:7].T.copy()
    pivots, inverse = np.zeros(ROOM * LANES), np.zeros(ROOM * LANES)
    lanes.cholesky_in_lanes(H, 7, pivots, inverse)
    lanes.substitute(H, 7, inverse, g)
    lanes.substitute_back(H, 7, inverse, g)
    assert (pivots.reshape(ROOM, LANES)[:7].min(axis=0) > 0.0).tolist() == [k != 2 for k in range(LANES)]
    for k in set(range(LANES)) - {2}:
        found = g.reshape(ROOM, LANES)[:7, k]
        np.testing.assert_allclose(found, np.linalg.solve(matrices[k], right[k]), rtol=1e-8, atol=1e-10)


@kernel
def _compiled(out: np.ndarray, a: np.ndarray, b: np.ndarray, rows: int, count: int, sign: float) -> None:
    """All operations, one after another."""
    lanes.add_dots(out, (1, 2), a, (3, 4), b, 5, rows, count, sign)
    lanes.add_multiple(out, 2, a, 7, b, 1, count, sign)
    lanes.multiply(out, (3, 3), b, 2, rows)


@pytest.mark.parametrize(("rows", "count"), [(0, 3), (1, 0), (3, 5), (4, 1), (9, 6)])
def test_the_instructions_do_what_the_python_functions_do(rows: int, count: int) -> None:
    rng = np.random.default_rng(rows)
    out, a, b = (rng.standard_normal((8, 8 * LANES)) for _ in range(3))
    expected = out.copy()
    lanes.add_dots(expected, (1, 2), a, (3, 4), b, 5, rows, count, -0.5)
    lanes.add_multiple(expected, 2, a, 7, b, 1, count, -0.5)
    lanes.multiply(expected, (3, 3), b, 2, rows)
    _compiled(out, a, b, rows, count, -0.5)
    np.testing.assert_allclose(out, expected, rtol=1e-12, atol=1e-12)
    z, x, y = (np.zeros(3 * LANES) for _ in range(3))
    x[:], y[:] = rng.standard_normal(3 * LANES), rng.standard_normal(3 * LANES)
    lanes.add_dots(z, (1, 1), x, (0, 1), y, 0, 1, 3, 2.0)
    by_hand = [2.0 * sum(x[q * LANES + k] * y[q * LANES + k] for q in range(3)) for k in range(LANES)]
    np.testing.assert_allclose(z[LANES : 2 * LANES], by_hand)
