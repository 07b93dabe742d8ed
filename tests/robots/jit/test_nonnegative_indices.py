"""Kernels take a computed index as it is; a negative constant counts from the end."""

from pathlib import Path

import numba
import numpy as np
import pytest

from contactsense.robots.jit.kernel import kernel

SECOND_LAST = -2


@kernel
def _last(a: np.ndarray) -> float:
    return float(a[-1] + 10.0 * a[SECOND_LAST])


@kernel
def _in_last_row(a: np.ndarray, j: int) -> float:
    a[-1, j] += 1.0
    a[SECOND_LAST, j] = 4.0
    return float(a[-1, j])


@kernel
def _item(a: np.ndarray, i: int) -> float:
    return float(a[i])


@kernel
def _set_item(a: np.ndarray, i: int, j: int) -> None:
    a[i, j] = 1.0


@kernel
def _sum_of_row(a: np.ndarray, i: int) -> float:
    row, total = a[i], 0.0
    for j in range(row.shape[0]):
        total += row[j]
    return total


@kernel
def _at(a: np.ndarray, place: tuple[int, int]) -> float:
    return float(a[place])


def test_a_negative_constant_counts_from_the_end() -> None:
    assert _last(np.array([1.0, 2.0, 3.0])) == 23.0
    a = np.arange(12.0).reshape(4, 3)
    assert _in_last_row(a, 1) == 11.0
    assert a[2, 1] == 4.0


def test_computed_indices_find_what_they_should() -> None:
    a = np.arange(12.0).reshape(4, 3)
    assert _item(a[0], 2) == 2.0
    assert _sum_of_row(a, 3) == 30.0
    assert _at(a, (2, 1)) == 7.0
    _set_item(a, 1, 2)
    assert a[1, 2] == 1.0


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="Python itself counts from the end")  # type: ignore[attr-defined]
def test_a_computed_index_does_not_count_from_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With Numba's check of bounds, a negative one is an error; else it would be found in the array."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(numba.config, "BOUNDSCHECK", 1)
    item = kernel(_item.py_func)
    set_item = kernel(_set_item.py_func)
    a = np.ones((3, 3))
    assert item(a[0], 1) == 1.0
    with pytest.raises(IndexError):
        item(a[0], -1)
    with pytest.raises(IndexError):
        set_item(a, 0, -1)
