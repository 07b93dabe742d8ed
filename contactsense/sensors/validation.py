"""Checks of arguments; errors name the argument, the expected value and the given one."""

import numpy as np

_NO_NUMBERS = "cmM"
"""Kinds of arrays that NumPy would convert: complex numbers without their imaginary parts, dates and
durations in their own unit."""


def checked_vector(name: str, value: object, size: int, unit: str) -> np.ndarray:
    """`value` as a contiguous float array of shape (size,).

    Raises:
        ValueError: it has another shape or type, or contains NaN or infinity; the message names the argument.
    """
    return checked_array(name, value, (size,), unit)


def checked_rows(name: str, value: object, rows: int | None, size: int, unit: str) -> np.ndarray:
    """`value` as a contiguous float array of shape (rows, size); any number of rows with `rows=None`.

    Raises:
        ValueError: it has another shape or type, or contains NaN or infinity; the message names the argument.
    """
    array = as_floats(name, value)
    if array.ndim != 2 or array.shape[1] != size or (rows is not None and len(array) != rows):
        expected = f"({'N' if rows is None else rows}, {size})"
        raise ValueError(f"{name}: expected shape {expected} in {unit}, got shape {array.shape}")
    _finite(name, array)
    return array


def checked_array(name: str, value: object, shape: tuple[int, ...], unit: str) -> np.ndarray:
    """`value` as a contiguous float array of that shape, all finite; otherwise a ValueError that names the
    argument."""
    array = as_floats(name, value)
    if array.shape != shape:
        raise ValueError(f"{name}: expected shape {shape} in {unit}, got shape {array.shape}")
    _finite(name, array)
    return array


def as_floats(name: str, value: object) -> np.ndarray:
    """`value` as a contiguous float array of any shape, NaN where it is masked; otherwise a ValueError that
    names the argument."""
    try:
        array = np.asarray(value)
        if value is None or array.dtype.kind in _NO_NUMBERS:  # NumPy would take None for NaN
            raise TypeError
        floats = np.ascontiguousarray(array, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: expected numbers, got {value!r:.60}") from None
    if isinstance(value, np.ma.MaskedArray):  # NumPy would take what is below the mask
        return np.where(np.ma.getmaskarray(value), np.nan, floats)
    return floats


def checked_flag(name: str, value: object) -> bool:
    """`value` as a truth value; otherwise a ValueError that names the argument: "no" would be true."""
    if isinstance(value, bool):
        return value
    if isinstance(value, np.bool_ | int) and value in (0, 1):
        return bool(value)
    raise ValueError(f"{name}: expected True or False, got {value!r:.60}")


def _finite(name: str, array: np.ndarray) -> None:
    if not np.isfinite(array).all():
        first = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise ValueError(f"{name}: expected finite numbers, got {array[first]} at index {list(first)}")
