"""Whole numbers that somebody has written, of any length."""

import math

_DIGITS = 308
"""A whole number of so many digits is a finite float."""


def integer(text: str) -> int | float:
    """The whole number that the decimal digits in `text` mean; beyond the range of floats it is infinite, as
    `1e999` is. Python refuses to read thousands of digits, in words that help no user."""
    return int(text) if len(text) <= _DIGITS else float(text)


def finite_or_infinite(value: int) -> int | float:
    """The same whole number; beyond the range of floats it is infinite. Python refuses to write thousands of
    digits, as in the message about such a value."""
    try:
        float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf
    return value
