"""An uncounted array is the same memory, and its owner's count stays as it was."""

import sys

import numpy as np
import pytest

from robots.compiled import kernel
from robots.uncounted import uncounted


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
