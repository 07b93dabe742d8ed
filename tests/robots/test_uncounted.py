"""Uncounted views are the same memory, and the owner's count stays as it was."""

import sys

import numpy as np
import pytest

from robots.compiled import kernel
from robots.uncounted import block, uncounted


@kernel
def _fill(array, rows, columns):  # type: ignore[no-untyped-def]
    view = uncounted(array)[1:].reshape(rows, columns)
    for i in range(rows):
        view[i, :] = i
    return view.sum()


@pytest.mark.parametrize("kind", [np.float64, np.int64])
def test_writes_through_and_leaves_the_count(kind: type) -> None:
    array = np.full(7, -1, dtype=kind)
    _fill(array, 2, 3)
    before = sys.getrefcount(array)
    assert [_fill(array, 2, 3) for _ in range(100)] == [3] * 100
    assert sys.getrefcount(array) == before
    assert array.tolist() == [-1, 0, 0, 0, 1, 1, 1]


def test_is_the_array_itself_without_a_compiler() -> None:
    array = np.zeros(3)
    assert uncounted(array) is array


@kernel
def _blocks(buffer, at, a, b, c):  # type: ignore[no-untyped-def]
    one, two, three = block(buffer, at, (a,)), block(buffer, at, (a, b)), block(buffer, at, (a, b, c))
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
        np.testing.assert_array_equal(block(buffer, at, shape), three.reshape(shape))
