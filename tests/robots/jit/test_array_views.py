"""Copies and views inside kernels: what NumPy's slices do, without allocation."""

import numpy as np
import pytest

from contactsense.robots.jit.array_views import copy, view
from contactsense.robots.jit.kernel import kernel


@pytest.mark.parametrize("kind", [np.float64, np.int64])
def test_copy_fills_the_output(kind: type) -> None:
    values, out = np.arange(5, dtype=kind), np.full(6, -1, dtype=kind)
    copy(values, out[::2])
    assert out.tolist() == [0, -1, 1, -1, 2, -1]


@kernel
def _blocks(
    buffer: np.ndarray, at: int, a: int, b: int, c: int
) -> tuple[float, float, float, tuple[int, ...], tuple[int, ...], tuple[int, ...]]:
    one, two, three = view(buffer, at, (a,)), view(buffer, at, (a, b)), view(buffer, at, (a, b, c))
    three[a - 1, b - 1, c - 1] *= 2
    return one.sum(), two[a - 1].sum(), three[0, b - 1].sum(), one.shape, two.shape, three.shape


@pytest.mark.parametrize("kind", [np.float64, np.int64])
def test_a_block_is_the_slice_in_that_shape(kind: type) -> None:
    buffer = np.arange(40, dtype=kind)
    expected = buffer.copy()
    for at, shape in ((0, (2, 3, 4)), (5, (3, 1, 2)), (16, (4, 3, 2))):
        a, b, c = shape
        expected[at + a * b * c - 1] *= 2
        one, two, three = expected[at:][:a], expected[at:][: a * b].reshape(a, b), expected[at:][: a * b * c]
        found = _blocks(buffer, at, a, b, c)
        assert found[:3] == (one.sum(), two[a - 1].sum(), three.reshape(shape)[0, b - 1].sum())
        assert found[3:] == ((a,), (a, b), shape)
        np.testing.assert_array_equal(buffer, expected)
        np.testing.assert_array_equal(view(buffer, at, shape), three.reshape(shape))
