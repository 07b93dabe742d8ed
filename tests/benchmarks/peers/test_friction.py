"""The small non-negative least squares against SciPy's, and the pyramid against the cone."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls

from contactsense.benchmarks.peers.friction import EDGES, edges, gram, solve

seeds = st.integers(0, 2**32 - 1)


def least(A: np.ndarray, b: np.ndarray) -> tuple[float, np.ndarray]:
    count = len(A)
    G, h, x = np.empty((count, count)), np.empty(count), np.empty(count)
    gram(A, b, 0, count, G, h)
    scratch = np.empty((count, count)), np.empty(count), np.empty(count, dtype=np.int64)
    return solve(G, h, b @ b, count, x, *scratch), x


@pytest.mark.slow
@settings(max_examples=300)
@given(seed=seeds, contacts=st.integers(1, 3), rows=st.integers(1, 13), dependent=st.booleans())
def test_as_good_as_scipy(seed: int, contacts: int, rows: int, dependent: bool) -> None:
    rng = np.random.default_rng(seed)
    A, b = rng.normal(size=(EDGES * contacts, rows)), rng.normal(size=rows)
    if dependent:
        A[3] = A[0] + A[1] - A[2]
    cost, x = least(A, b)
    assert (x >= 0.0).all()
    np.testing.assert_allclose(cost, np.sum((A.T @ x - b) ** 2), atol=1e-8 * (b @ b))
    assert cost == pytest.approx(nnls(A.T, b)[1] ** 2, abs=1e-8 * (b @ b))


@pytest.mark.slow
@settings(max_examples=100)
@given(seed=seeds)
def test_pyramid_holds_the_cone(seed: int) -> None:
    """Every force within friction is a sum of edge forces."""
    rng = np.random.default_rng(seed)
    normal, aside = rng.normal(size=(2, 3))
    normal /= np.linalg.norm(normal)
    aside = np.cross(normal, aside)
    force = 0.5 * aside / np.linalg.norm(aside) - normal
    corners = np.empty((EDGES, 3))
    edges(*normal, 0.5, corners)
    assert least(corners, force)[0] < 1e-12
    np.testing.assert_allclose(corners @ normal, -1.0)


def test_pulling_is_not_explained() -> None:
    corners = np.empty((EDGES, 3))
    edges(0.0, 0.0, 1.0, 0.5, corners)
    cost, x = least(corners, np.array([0.0, 0.0, 3.0]))
    assert cost == pytest.approx(9.0)
    assert (x == 0.0).all()
