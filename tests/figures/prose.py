"""Figures in prose."""

import re
from collections.abc import Iterator
from typing import NamedTuple

SHARES = ("%", "point", "points")
UNITS = (*SHARES, "times", "mm", "µm", "cm", "m", "ns", "µs", "us", "ms", "s", "N", "Nm", "MB", "GB", "TB")
CONVENTIONS = frozenset(
    {
        *("90 %", "95 %", "99.9 %", "19 of", "20 of", "99 of", "100 of"),  # levels of regions and quantiles
        *("0.05 N", "0.25 N", "1 N", "0.01 Nm", "0.05 Nm", "0.2 Nm", "0.3 Nm", "1 Nm", "3 Nm"),  # usual noise
        *("5 N", "20 N", "60 N", "0.5 N", "2 N"),  # usual forces, and how well earlier ones are known
        "22.5 mm",  # largest error of a contact that counts as found
    }
)
"""Figures that are never measured."""

NUMBER = r"\d+(?:,\d{3})*(?:\.\d+)?"
_LIST = rf"{NUMBER}(?:(?:,| and| to| or|,? instead of|,? then|-| /) ?{NUMBER})*"
_FIGURES = re.compile(
    rf"(?<![\w.,/-])(?:({_LIST})\s?({'|'.join(UNITS)})(?![\w/])|{NUMBER} of (?:the )?{NUMBER}\b)"
)
_SHARES = re.compile(rf"(?P<level>(?:90|95|99\.9) %)|\(?(?:{_LIST})(?: \([^()\n]*)?\)? ?%")
"""Levels, and numbers with a `%`, also with an interval in brackets."""
_NAMED = {"times": "", "of": ""}
"""Units that outputs do not name."""
_NO_PROSE = re.compile(r"`[^`]+`|\]\([^)\s]+\)")
"""Code and addresses."""


class Figure(NamedTuple):
    """A number with its unit."""

    text: str
    value: float
    unit: str
    """As written; `of` in a count such as `10 of 11`."""
    place: int
    """Where it begins in the prose."""


def figures(prose: str) -> Iterator[Figure]:
    """All figures but the conventions; in a list of numbers each has the unit of the last one."""
    masked = _NO_PROSE.sub(lambda found: "`" * len(found[0]), prose)
    for found in _FIGURES.finditer(masked):
        unit = found[2] or "of"
        for number in re.finditer(NUMBER, found[0]):
            if f"{number[0]} {unit}" not in CONVENTIONS:
                yield Figure(number[0], value(number[0]), unit, found.start() + number.start())


def value(number: str) -> float:
    """A number as written, with commas between thousands."""
    return float(number.replace(",", ""))


def is_rounding(figure: Figure, number: float) -> bool:
    """Whether the figure is the number, rounded to the figure's digits."""
    digits = len(figure.text.partition(".")[2])
    return abs(figure.value - number) <= 0.5 * 10.0**-digits + 1e-9


def is_shown(figure: Figure, output: str) -> bool:
    """Whether the figure is a rounding of a number in an output.

    A share is a number with a `%`; where only the header of an output has a `%`, any number may be a share.
    Other figures are numbers without a `%`, in an output that names their unit.
    """
    shares = [found for found in _SHARES.finditer(output) if not found["level"]]
    if figure.unit in SHARES and shares:
        output = " ".join(found[0] for found in shares)
    elif figure.unit in SHARES and "%" not in output:
        return False
    elif figure.unit not in SHARES:
        if not re.search(rf"(?<![A-Za-z]){_NAMED.get(figure.unit, figure.unit)}(?![A-Za-z])", output):
            return False
        output = _SHARES.sub(" ", output)
    numbers = re.findall(rf"(?<![\d.])({NUMBER})(?![\d.])", output)
    return any(is_rounding(figure, value(number)) for number in numbers)
