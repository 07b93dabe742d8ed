"""Whole numbers that somebody has written, of any length."""

_DIGITS = 308
"""A whole number of so many digits is a finite float."""


def integer(text: str) -> int | float:
    """The whole number that the decimal digits in `text` mean; beyond the range of floats it is infinite, as
    `1e999` is. Python refuses to read thousands of digits, in words that help no user."""
    return int(text) if len(text) <= _DIGITS else float(text)
