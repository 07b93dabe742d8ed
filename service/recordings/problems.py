"""Problems found in a recording, by row."""

from dataclasses import dataclass
from typing import Literal

Kind = Literal[
    "repeated",
    "gap",
    "clock_set_back",
    "not_finite",
    "bad_row",
    "cut_short",
    "missing_sensor",
    "schema",
    "held",
]


class RecordingError(ValueError):
    """A recording that cannot be used: the message names the file, the column, the expected value and the
    actual one."""


@dataclass(frozen=True, slots=True)
class Problem:
    """Rows of a recording that are missing, unusable or out of order; the other rows are used."""

    row_from: int
    """First affected row, counted from 0 in the file, without the header."""
    row_to: int
    """Row after the last affected one."""
    kind: Kind
    message: str

    def __str__(self) -> str:
        last = self.row_to - 1
        rows = f"row {self.row_from}" if last <= self.row_from else f"rows {self.row_from} to {last}"
        return f"{rows}: {self.message}"
