"""The written-out solver against NumPy's."""

import math

import numpy as np
import pytest

from contactsense.kinematics.linalg.ldl import invert_spd, ldl_solve


@pytest.mark.parametrize("scale", [1e-8, 1.0, 1e8])
def test_solution_determinant_and_the_corner_of_the_inverse(scale: float) -> None:
    chance = np.random.default_rng(6)
    for _ in range(50):
        root = chance.standard_normal((6, 6))
        H = scale * (root @ root.T + 0.1 * np.eye(6))
        g = chance.standard_normal(6)
        x = g.copy()
        log_det, predicted_decrease, a, b, c = ldl_solve(np.triu(H), x)
        np.testing.assert_allclose(x, np.linalg.solve(H, g), rtol=1e-8)
        assert log_det == pytest.approx(np.linalg.slogdet(H)[1], rel=1e-9, abs=1e-9)
        assert predicted_decrease == pytest.approx(0.5 * g @ np.linalg.solve(H, g), rel=1e-8)
        np.testing.assert_allclose([[a, b], [b, c]], np.linalg.inv(H)[4:, 4:], rtol=1e-7)


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan])
def test_a_matrix_that_is_not_positive_says_so(bad: float) -> None:
    H = np.eye(6)
    H[3, 3] = bad
    assert ldl_solve(H, np.ones(6))[0] == math.inf


def test_a_covariance_is_inverted() -> None:
    chance = np.random.default_rng(1)
    out = np.empty((6, 6))
    for scale in (1.0, 1e-3):
        root = chance.standard_normal((6, 6)) * np.repeat([1.0, scale], 3)[:, None]
        invert_spd(root @ root.T, out)
        np.testing.assert_allclose(out @ (root @ root.T), np.eye(6), atol=1e-6)
